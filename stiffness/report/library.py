"""Link stiffnesses kept on disk, with where they came from.

A library is a folder of one JSON file an entry, each written whole or not at all, so a
build can be interrupted, resumed and shared.  An entry holds the stiffness, its error,
the mesh, the parameters and material it was made for, the geometry's fingerprint, the
program's version and the date.
"""

import itertools
import json
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.display import html_table, short_repr
from forcefit.inputs.errors import checked
from forcefit.inputs.table import BadInput, nearest, read_text, read_toml
from forcefit.inputs.writing import write_json
from stiffness.beam.curve import curve_compliance
from stiffness.link import LinkStiffness, check_definite, inverted, scaled
from stiffness.report.library_surface import SurfaceLink, is_current, read_surface_links
from stiffness.report.results import link_results
from stiffness.screws import SCREW, WRENCH
from stiffness.surface.beam_surfaces import check_shape, shape_beam, shape_surface

FORMAT = "forcefit link 1"
_MATERIAL = ("young", "poisson", "density")
_METHODS = ("beam", "fea")
_LARGEST = 1e15  # in SI: beyond any length, modulus or density


@dataclass(frozen=True, eq=False)
class Entry:
    """A stored link.

    Attributes:
        key: its name in the library.
        stiffness: (6, 6) at the tip, in the link's axes.
        stiffness_error: (6, 6) estimate of the error of the stiffness.
        tip: (3,) [m].
        parameters: lengths [m] and material it was made for, by name.
        about: everything stored.
    """

    key: str
    stiffness: NDArray
    stiffness_error: NDArray
    tip: NDArray
    parameters: dict[str, float]
    about: dict[str, Any]

    __repr__, _repr_html_ = short_repr, html_table


@dataclass(frozen=True)
class Spec:
    """What a library is to hold.

    Attributes:
        folder: of the library.
        shape: of all entries.
        method: ``"beam"`` or ``"fea"``.
        grid: values of each parameter: lengths [m], ``young`` [Pa], ...
        accuracy: asked of finite elements.
        links: parts given by their surface, beside the grid or in its stead.
    """

    folder: Path
    shape: str
    method: str
    grid: dict[str, tuple[float, ...]]
    accuracy: float = 0.005
    links: tuple[SurfaceLink, ...] = ()

    def points(self) -> list[dict[str, float]]:
        """Every combination of the grid's values; none without a shape."""
        if not self.shape:
            return []
        names = list(self.grid)
        return [
            dict(zip(names, values, strict=True))
            for values in itertools.product(*self.grid.values())
        ]


def read_spec(path: Path | str) -> Spec:
    """What a build file asks for.

    Args:
        path: TOML with ``library`` and ``accuracy``; ``shape``, ``method`` and a table
            ``grid`` of lists of numbers; tables ``[[link]]`` of parts given by their
            surface; the grid, the links, or both.

    Returns:
        The spec; the folder is relative to the file.

    Raises:
        BadInput: the file, a name or a value is not proper.
    """
    path = Path(path)
    table = read_toml(path)
    folder = path.parent / table.text("library")
    accuracy = table.number("accuracy", "1", 0.005, least=1e-5, below=0.5)
    links = read_surface_links(table, accuracy)
    if links and not (table.has("shape") or table.has("grid")):
        table.finish()
        return Spec(folder, "", "fea", {}, accuracy, links)
    grid_table = table.table("grid")
    grid = {}
    for name in list(grid_table.content):
        values = grid_table.get(name)
        given = values if isinstance(values, list) else [values]
        if not given or not all(_is_number(v) for v in given):
            raise grid_table.bad(name, "expected a finite number, or a list of them")
        if len(set(given)) != len(given):
            raise grid_table.bad(name, "a value stands there twice")
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
    """A number of a sane size, not true or false."""
    proper = isinstance(value, int | float) and not isinstance(value, bool)
    return proper and -_LARGEST <= value <= _LARGEST  # type: ignore[operator]


def _lengths(point: Mapping[str, float]) -> dict[str, float]:
    """The parameters that are lengths."""
    return {name: v for name, v in point.items() if name not in _MATERIAL}


def entry_key(spec: Spec, point: Mapping[str, float]) -> str:
    """Name of an entry, the same for the same parameters.

    Args:
        spec: of its library.
        point: its parameters.

    Returns:
        Such as ``round-fea-length0.4-radius0.02-young6e+10-poisson0.3``.
    """
    values = "-".join(f"{name}{value:.9g}" for name, value in point.items())
    return f"{spec.shape}-{spec.method}-{values}"


def build_library(
    spec: Spec,
    workers: int = 1,
    update: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Compute the entries that are not there yet.

    Args:
        spec: what is wanted.
        workers: processes.
        update: called with entries done and wanted.

    Returns:
        Files of all entries of the spec.

    Raises:
        BadInput: the folder cannot be made, or an entry cannot be computed.
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
    """The folder of a library; without ``write`` only whether there can be one."""
    try:
        made = [one for one in (folder, *folder.parents) if not one.exists()]
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"{folder}: cannot be made: {error.strerror}") from None
    if not write:
        for one in made:
            one.rmdir()


def _key(spec: Spec, wanted: dict[str, float] | SurfaceLink) -> str:
    """Name of an entry of either kind."""
    if isinstance(wanted, SurfaceLink):
        return wanted.name
    return entry_key(spec, wanted)


def _make_entry(spec: Spec, wanted: dict[str, float] | SurfaceLink) -> None:
    """Compute one entry and write it."""
    if isinstance(wanted, SurfaceLink):
        request = wanted.request()
        link, parameters = wanted.solve(), wanted.parameters
        about = {"surface": wanted.surface.name, "request": request}
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
    """The link of one point, and its geometry's fingerprint."""
    lengths, E, nu = _lengths(point), point["young"], point["poisson"]
    tip = np.array([0.0, 0.0, lengths["length"]])
    if spec.method == "beam":
        C = curve_compliance(shape_beam(spec.shape, lengths, nu), E, nu)
        return LinkStiffness("Timoshenko beam", C, tip=tip, base=np.zeros(3)), ""
    from stiffness.fem.fea import solve_link
    from stiffness.fem.material import Material
    from stiffness.surface.interface import parse_interface

    surface = shape_surface(spec.shape, lengths)
    solved = solve_link(
        surface,
        parse_interface("z=0"),
        parse_interface(f"z={lengths['length']!r}"),
        [Material(E, nu, point.get("density", 0.0))],
        accuracy=spec.accuracy,
    )
    return solved.link, surface.digest()


def _program() -> str:
    """Name and version of this program."""
    try:
        return f"forcefit {version('forcefit')}"
    except PackageNotFoundError:
        return "forcefit, not installed"


def read_entry(path: Path | str, key: str) -> Entry:
    """One entry of a library.

    Args:
        path: the library's folder.
        key: the entry's.

    Returns:
        The entry.

    Raises:
        BadInput: there is no such library or entry, or the file is damaged.
    """
    path = Path(path)
    if not os.path.isdir(path):
        raise BadInput(f"{path}: no library there; expected a folder of entries")
    file = path / f"{key}.json"
    if Path(key).name != key or not os.path.isfile(file):
        known = [p.stem for p in sorted(path.glob("*.json"))]
        raise BadInput(f'{path}: no entry "{key}"{nearest(key, known)}')
    return _entry(file)


def _entry(file: Path) -> Entry:
    """The content of an entry's file."""
    try:
        about = json.loads(read_text(file))
        if about.get("format") != FORMAT:
            raise BadInput(f'{file}: not an entry; expected format "{FORMAT}"')
        if about["screw"] != list(SCREW) or about["wrench"] != list(WRENCH):
            raise BadInput(f"{file}: written in another order than {' '.join(SCREW)}")
        arrays = [
            np.array(about[name], dtype=float)
            for name in ("stiffness", "stiffness_error", "tip")
        ]
        parameters = {str(k): float(v) for k, v in about["parameters"].items()}
        float(about["relative_error_estimate"])
    except BadInput:
        raise
    except (ValueError, OverflowError, LookupError, TypeError, AttributeError) as error:
        raise BadInput(f"{file}: damaged entry ({type(error).__name__})") from None
    K, error_matrix, tip = arrays
    if K.shape != (6, 6) or error_matrix.shape != (6, 6) or tip.shape != (3,):
        raise BadInput(f"{file}: a matrix has another shape than 6 by 6")
    if not all(np.isfinite(array).all() for array in arrays):
        raise BadInput(f"{file}: a number is not finite")
    check_definite(f"{file}: stiffness", K)
    return Entry(file.stem, K, error_matrix, tip, parameters, about)


def read_compliance(path: Path | str, key: str) -> NDArray:
    """Compliance of one entry.

    Args:
        path: the library's folder.
        key: the entry's.

    Returns:
        (6, 6) [rad/(N m) .. m/N].

    Raises:
        BadInput: there is no such library or entry, or the file is damaged.
    """
    return inverted(read_entry(path, key).stiffness)


def read_library(path: Path | str) -> list[Entry]:
    """All entries of a library, in the order of their keys.

    Args:
        path: the folder.

    Returns:
        The entries.

    Raises:
        BadInput: there is no library, nothing in it, or a damaged entry.
    """
    path = Path(path)
    files = sorted(path.glob("*.json")) if os.path.isdir(path) else []
    if not files:
        raise BadInput(f"{path}: no library there; expected a folder of entries")
    return [_entry(file) for file in files]


def look_up(
    entries: Sequence[Entry], wanted: Mapping[str, float]
) -> tuple[NDArray, NDArray]:
    """Stiffness at wanted parameters, interpolated between a grid's entries.

    Logarithms of the diagonal and the scaled rest are interpolated by polynomials of
    logarithms of the parameters, through up to four neighbours along each axis: links'
    stiffnesses are nearly powers of their lengths.

    Args:
        entries: a full grid.
        wanted: a value of every parameter; of one that has a single value in the grid
            it may be left out.

    Returns:
        (6, 6) stiffness, and (6, 6) the sizes of its error: what one neighbour fewer
        along each axis changes, and the entries' own errors.

    Raises:
        BadInput: a parameter is unknown, missing or outside the grid, or the entries
            do not fill a grid.
    """
    # parts given by their surface are beside any grid
    entries = [entry for entry in entries if "surface" not in entry.about]
    if not entries:
        raise BadInput("look-up: found only entries of surfaces, expected a grid")
    names = list(entries[0].parameters)
    for name in wanted:
        if name not in names:
            raise BadInput(f'look-up: unknown parameter "{name}"{nearest(name, names)}')
    axes = [sorted({e.parameters[name] for e in entries}) for name in names]
    single = {n: a[0] for n, a in zip(names, axes, strict=True) if len(a) == 1}
    wanted = single | dict(wanted)
    for name, axis in zip(names, axes, strict=True):
        if name not in wanted:
            raise BadInput(f"look-up: {name}: missing; the grid has it")
        if not axis[0] <= wanted[name] <= axis[-1]:
            raise BadInput(
                f"look-up: {name} = {wanted[name]:g} is outside the grid, "
                f"{axis[0]:g} .. {axis[-1]:g}; nothing is extrapolated"
            )
    if len(entries) != np.prod([len(axis) for axis in axes]):
        raise BadInput("look-up: the entries do not fill a grid of their parameters")
    place = {tuple(e.parameters[n] for n in names): e for e in entries}
    most = [4] * len(names)
    best = _interpolated(place, axes, [wanted[n] for n in names], most)
    error = np.zeros((6, 6))
    for k, axis in enumerate(axes):
        if len(axis) > 1:
            fewer = [*most[:k], min(len(axis), 4) - 1, *most[k + 1 :]]
            other = _interpolated(place, axes, [wanted[n] for n in names], fewer)
            error += np.abs(other - best)
    own = max(np.abs(scaled(e.stiffness_error, e.stiffness)).max() for e in entries)
    scale = np.sqrt(np.outer(np.diag(best), np.diag(best)))
    return best, error + own * scale


def _interpolated(
    place: Mapping[tuple[float, ...], Entry],
    axes: Sequence[Sequence[float]],
    at: Sequence[float],
    most: Sequence[int],
) -> NDArray:
    """Tensor product of Lagrange's polynomials through the nearest values."""
    chosen, weights = [], []
    for axis, value, count in zip(axes, at, most, strict=True):
        near = sorted(axis, key=lambda v: abs(np.log(v / value)))[: max(count, 1)]
        x, t = np.log(near), np.log(value)
        w = [
            np.prod([(t - x[j]) / (x[i] - x[j]) for j in range(len(x)) if j != i])
            for i in range(len(x))
        ]
        chosen.append(near)
        weights.append(w)
    total = np.zeros((6, 6))
    for index in itertools.product(*(range(len(c)) for c in chosen)):
        K = place[tuple(chosen[k][i] for k, i in enumerate(index))].stiffness
        shape = scaled(K, K)
        shape[range(6), range(6)] = np.log(np.diag(K))
        total += np.prod([weights[k][i] for k, i in enumerate(index)]) * shape
    size = np.exp(np.diag(total) / 2)
    total[range(6), range(6)] = 1.0
    return total * np.outer(size, size)
