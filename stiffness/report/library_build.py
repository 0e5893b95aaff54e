"""Computation of the entries of a library.

A build can be interrupted and continued later, and several processes can build the same
library.
"""

import itertools
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from forcefit.inputs.errors import LARGEST, checked
from forcefit.inputs.table import BadInput, read_toml
from forcefit.inputs.writing import write_json
from forcefit.stiffness.beam.curve import curve_compliance
from forcefit.stiffness.link import LinkStiffness
from forcefit.stiffness.report.library import FORMAT
from forcefit.stiffness.report.library_surface import (
    SurfaceLink,
    is_current,
    read_surface_links,
)
from forcefit.stiffness.report.results import link_results
from forcefit.stiffness.surface.beam_surfaces import (
    check_shape,
    shape_beam,
    shape_surface,
)

_MATERIAL = ("young", "poisson", "density")
_METHODS = ("beam", "fea")


@dataclass(frozen=True)
class Spec:
    """Description of a library.

    Attributes:
        folder: folder of the library.
        shape: shape of all entries of the grid.
        method: ``"beam"`` or ``"fea"``.
        grid: values of each parameter, such as ``length`` [m] and ``young`` [Pa].
        accuracy: largest accepted relative error of the finite element stiffness.
        links: parts given by surfaces.
    """

    folder: Path
    shape: str
    method: str
    grid: dict[str, tuple[float, ...]]
    accuracy: float = 0.005
    links: tuple[SurfaceLink, ...] = ()

    def points(self) -> list[dict[str, float]]:
        """Return all combinations of parameter values in the grid."""
        if not self.shape:
            return []
        names = list(self.grid)
        return [
            dict(zip(names, values, strict=True))
            for values in itertools.product(*self.grid.values())
        ]


def read_spec(path: Path | str) -> Spec:
    """Read a build file.

    Args:
        path: TOML file with the keys ``library`` and ``accuracy``. A grid is defined by
            the keys ``shape``, ``method`` and a table ``grid`` with lists of values.
            Parts given by surfaces are defined by tables ``[[link]]`` or
            ``[[family]]``.

    Returns:
        The description of the library.

    Raises:
        BadInput: the file, a key or a value is invalid.
    """
    path = Path(path)
    table = read_toml(path)
    folder = path.parent / table.text("library")
    accuracy = table.number("accuracy", "1", 0.005, least=1e-5, below=0.5)
    links = read_surface_links(table, accuracy)
    if links and not (table.has("shape") or table.has("grid")):
        table.finish()
        return Spec(
            folder=folder,
            shape="",
            method="fea",
            grid={},
            accuracy=accuracy,
            links=links,
        )
    grid_table = table.table("grid")
    grid = {}
    for name in list(grid_table.content):
        values = grid_table.get(name)
        given = values if isinstance(values, list) else [values]
        if not given or not all(_is_number(v) for v in given):
            raise grid_table.bad(name, "expected a finite number, or a list of them")
        if len(set(given)) != len(given):
            raise grid_table.bad(name, "found a value twice, expected different values")
        grid[name] = tuple(sorted(float(v) for v in given))
    shape = table.text("shape")
    spec = Spec(
        folder=folder,
        shape=shape,
        method=table.choice("method", _METHODS, "fea"),
        grid=grid,
        accuracy=accuracy,
        links=links,
    )
    table.finish()
    for name in ("young", "poisson"):
        if name not in grid:
            raise grid_table.bad(name, "missing; expected a number or a list")
    for point in spec.points():
        check_shape(shape, _lengths(point))
        checked(f"{path}: grid.young", point["young"], "Pa", above=0)
        checked(f"{path}: grid.poisson", point["poisson"], "1", above=-1, below=0.5)
    return spec


def _is_number(value: object) -> bool:
    """Return whether a value is a number of valid size."""
    proper = isinstance(value, int | float) and not isinstance(value, bool)
    return proper and -LARGEST <= value <= LARGEST  # type: ignore[operator]


def _lengths(point: Mapping[str, float]) -> dict[str, float]:
    """Return the dimensions [m] among the parameters."""
    return {name: v for name, v in point.items() if name not in _MATERIAL}


def entry_key(spec: Spec, point: Mapping[str, float]) -> str:
    """Return the key of an entry, which is unique for its parameters.

    Args:
        spec: description of the library.
        point: parameters of the entry.

    Returns:
        The key, such as ``round-fea-length0.4-radius0.02-young6e+10-poisson0.3``.
    """
    values = "-".join(f"{name}{value:.9g}" for name, value in point.items())
    return f"{spec.shape}-{spec.method}-{values}"


def build_library(
    spec: Spec,
    workers: int = 1,
    update: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Compute the missing entries of a library.

    Args:
        spec: description of the library.
        workers: number of processes.
        update: callback that is called with the number of finished entries and the
            number of all entries.

    Returns:
        Paths of the files of all entries.

    Raises:
        BadInput: the folder cannot be created, or an entry cannot be computed.
    """
    _make_folder(spec.folder, write=False)
    wanted: list[dict[str, float] | SurfaceLink] = [*spec.points(), *spec.links]
    files = [spec.folder / f"{_key(spec, one)}.json" for one in wanted]
    tell = update or (lambda done, total: None)
    waiting = [
        one
        for one, file in zip(wanted, files, strict=True)
        if not (
            is_current(file, one) if isinstance(one, SurfaceLink) else file.exists()
        )
    ]
    done = len(wanted) - len(waiting)
    tell(done, len(wanted))
    make = partial(_make_entry, spec)
    if workers == 1:
        for one in waiting:
            make(one)
            done += 1
            tell(done, len(wanted))
        return files
    with ProcessPoolExecutor(workers) as pool:
        for job in as_completed([pool.submit(make, one) for one in waiting]):
            job.result()
            done += 1
            tell(done, len(wanted))
    return files


def _make_folder(folder: Path, write: bool = True) -> None:
    """Create the folder of a library, or check that it can be created."""
    try:
        made = [one for one in (folder, *folder.parents) if not one.exists()]
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"{folder}: cannot be created: {error.strerror}") from None
    if not write:
        for one in made:
            one.rmdir()


def _key(spec: Spec, wanted: dict[str, float] | SurfaceLink) -> str:
    """Return the key of an entry."""
    if isinstance(wanted, SurfaceLink):
        return wanted.name
    return entry_key(spec, wanted)


def _make_entry(spec: Spec, wanted: dict[str, float] | SurfaceLink) -> None:
    """Compute an entry, and write its file."""
    if isinstance(wanted, SurfaceLink):
        request = wanted.request()
        link, parameters = wanted.solve(), wanted.parameters
        about = {"surface": wanted.surface.name, "request": request}
        if wanted.family:
            about["family"] = wanted.family
    else:
        link, geometry = _solve_point(spec, wanted)
        parameters, about = wanted, {"shape": spec.shape, "geometry": geometry}
    key = _key(spec, wanted)
    _make_folder(spec.folder)
    content = (
        link_results(link)
        | about
        | {
            "format": FORMAT,
            "key": key,
            "parameters": parameters,
            "stiffness_error": link.stiffness_error,
            "program": _program(),
            "date": datetime.now(UTC).isoformat(timespec="seconds"),
        }
    )
    write_json(content, str(spec.folder / f"{key}.json"))


def _solve_point(spec: Spec, point: dict[str, float]) -> tuple[LinkStiffness, str]:
    """Compute the link for given parameters, and a hash of its geometry."""
    lengths, E, nu = _lengths(point), point["young"], point["poisson"]
    tip = np.array([0.0, 0.0, lengths["length"]])
    if spec.method == "beam":
        C = curve_compliance(shape_beam(spec.shape, lengths, nu), E, nu)
        return LinkStiffness("Timoshenko beam", C, tip=tip, base=np.zeros(3)), ""
    from forcefit.stiffness.fem.fea import FemOptions, solve_link
    from forcefit.stiffness.fem.material import Material
    from forcefit.stiffness.surface.interface import parse_interface

    surface = shape_surface(spec.shape, lengths)
    solved = solve_link(
        surface,
        parse_interface("z=0"),
        parse_interface(f"z={lengths['length']!r}"),
        [Material(E, nu, point.get("density", 0.0))],
        options=FemOptions(spec.accuracy),
    )
    return solved.link, surface.digest()


def _program() -> str:
    """Return the name and version of this program."""
    try:
        return f"forcefit {version('forcefit')}"
    except PackageNotFoundError:
        return "forcefit, not installed"
