"""Optional packages, which only some functions need, and how to install them.

A module imports an optional package inside the function that uses it.  If the package
is missing, :func:`naming_packages` raises an error of one line.  All commands use it.
"""

from collections.abc import Generator
from contextlib import contextmanager

from forcefit.inputs.errors import BadInput

# for each optional package, the extra of pyproject.toml that installs it
_EXTRAS = {
    "dask": "sweeps",
    "distributed": "sweeps",
    "gmsh": "gmsh",
    "h5netcdf": "sweeps",
    "h5py": "sweeps",
    "matplotlib": "report",
    "meshio": "msh",
    "mujoco": "mujoco",
    "pandas": "sweeps",
    "pypardiso": "mkl",
    "rosbags": "ros",
    "xarray": "sweeps",
    "yaml": "yaml",
}
# packages that every installation of forcefit contains
_REQUIRED = (
    "clarabel", "cvxpy", "exudyn", "filelock", "jinja2", "numpy", "pytetwild",
    "pyvista", "rich", "scipy", "threadpoolctl", "typer", "vtkmodules",
)  # fmt: skip
# packages whose distribution has a different name than the imported module
_DISTRIBUTIONS = {"yaml": "pyyaml", "vtkmodules": "vtk"}


@contextmanager
def naming_packages(
    whose: str = "this command", instead: str = ""
) -> Generator[None, None, None]:
    """Replace the import error of a block by a message with installation instructions.

    Args:
        whose: name of the function or command that needs the package.
        instead: alternative without the package.

    Raises:
        BadInput: a package that forcefit uses is missing.
        ModuleNotFoundError: any other module is missing.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        distribution = _DISTRIBUTIONS.get(package, package)
        if package in _EXTRAS:
            cure = f"install forcefit[{_EXTRAS[package]}]"
        elif package in _REQUIRED:
            cure = f"install {distribution}"
        else:
            raise
        also = f", or {instead}" if instead else ""
        raise BadInput(
            f"{whose} needs the package {distribution}; {cure}{also}"
        ) from None


def need(*packages: str) -> None:
    """Raise an error before a computation if a required package is not installed.

    Args:
        packages: names by which the packages are imported.

    Raises:
        ModuleNotFoundError: a package is missing; the message names the first one.
    """
    from importlib.util import find_spec

    for package in packages:
        if find_spec(package) is None:
            raise ModuleNotFoundError(f"No module named {package!r}", name=package)
