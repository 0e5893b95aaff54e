"""Packages that only some questions need, and what to install where one is missing.

A module imports such a package where it is used; that it is missing is found there, and
said in one line by :func:`naming_packages`, which the command line wraps around all.
"""

from collections.abc import Generator
from contextlib import contextmanager

from forcefit.inputs.errors import BadInput

# the extra that brings a package; pyproject.toml says what an extra is for
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
# absent only where forcefit was installed without what it requires
_REQUIRED = (
    "clarabel", "cvxpy", "exudyn", "filelock", "jinja2", "numpy", "pytetwild",
    "pyvista", "rich", "scipy", "threadpoolctl", "typer", "vtkmodules",
)  # fmt: skip
_DISTRIBUTIONS = {"yaml": "pyyaml", "vtkmodules": "vtk"}  # named otherwise


@contextmanager
def naming_packages(
    whose: str = "this command", instead: str = ""
) -> Generator[None, None, None]:
    """Say which package a block lacks, and what to install.

    Args:
        whose: what needs it.
        instead: what else can be done.

    Raises:
        BadInput: a package is missing that forcefit knows.
        ModuleNotFoundError: another module is.
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
    """Refuse work whose end would need a package that is missing.

    Args:
        packages: names as they are imported.

    Raises:
        ModuleNotFoundError: the first of them that is missing.
    """
    from importlib.util import find_spec

    for package in packages:
        if find_spec(package) is None:
            raise ModuleNotFoundError(f"No module named {package!r}", name=package)
