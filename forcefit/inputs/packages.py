"""Optional packages, and installation hints if one of them is missing.

Optional packages are imported inside the functions that use them.  If a package is
missing, :func:`naming_packages`, which all commands use, raises a one-line error.
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
# packages that are installed with forcefit
_REQUIRED = (
    "clarabel", "cvxpy", "exudyn", "filelock", "jinja2", "numpy", "pytetwild",
    "pyvista", "rich", "scipy", "threadpoolctl", "typer", "vtkmodules",
)  # fmt: skip
# distribution names that differ from the name of the imported module
_DISTRIBUTIONS = {"yaml": "pyyaml", "vtkmodules": "vtk"}


@contextmanager
def naming_packages(
    whose: str = "this command", instead: str = ""
) -> Generator[None, None, None]:
    """Replace an import error in a block by a message with installation instructions.

    Args:
        whose: function or command that requires the package, for the message.
        instead: alternative that does not require the package, for the message.

    Raises:
        BadInput: a package used by forcefit is missing.
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
    """Check that packages are installed, before starting a computation.

    Args:
        packages: import names of the packages.

    Raises:
        ModuleNotFoundError: a package is missing; the message names the first one.
    """
    from importlib.util import find_spec

    for package in packages:
        if find_spec(package) is None:
            raise ModuleNotFoundError(f"No module named {package!r}", name=package)
