"""Libraries of link stiffnesses.

A library is a folder with one JSON file for each entry. The file contains the stiffness
and its estimated error, the parameters and material of the link, and the program
version. Entries are computed by :mod:`forcefit.stiffness.report.library_build`.
"""

import itertools
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput, nearest, read_text
from forcefit.results.display import html_table, short_repr
from forcefit.stiffness.link import check_definite, inverted, scaled
from forcefit.stiffness.screws import SCREW, WRENCH

FORMAT = "forcefit link 1"


@dataclass(frozen=True, eq=False)
class Entry:
    """An entry of a library: a link stiffness with its parameters.

    Attributes:
        key: name of the entry in the library.
        stiffness: (6, 6) stiffness at the tip, in the axes of the link.
        stiffness_error: (6, 6) estimated error of the stiffness.
        tip: (3,) [m] position of the tip.
        parameters: dimensions [m] and material constants of the link, by name.
        about: complete content of the file.
    """

    key: str
    stiffness: NDArray
    stiffness_error: NDArray
    tip: NDArray
    parameters: dict[str, float]
    about: dict[str, Any]

    __repr__, _repr_html_ = short_repr, html_table


def read_entry(path: Path | str, key: str) -> Entry:
    """Read an entry of a library.

    Args:
        path: folder of the library.
        key: name of the entry.

    Returns:
        The entry.

    Raises:
        BadInput: the library or the entry does not exist, or the file is damaged.
    """
    path = Path(path)
    if not os.path.isdir(path):
        raise BadInput(f"{path}: found no library, expected a folder of entries")
    file = path / f"{key}.json"
    if Path(key).name != key or not os.path.isfile(file):
        known = [p.stem for p in sorted(path.glob("*.json"))]
        raise BadInput(f'{path}: no entry "{key}"{nearest(key, known)}')
    return _entry(file)


def _entry(file: Path) -> Entry:
    """Read the file of an entry."""
    try:
        about = json.loads(read_text(file))
        if about.get("format") != FORMAT:
            raise BadInput(
                f"{file}: the file is not an entry of a library; expected the format "
                f'"{FORMAT}"'
            )
        if about["screw"] != list(SCREW) or about["wrench"] != list(WRENCH):
            raise BadInput(
                f"{file}: found the components in another order, expected "
                f"{' '.join(SCREW)}"
            )
        arrays = [
            np.array(about[name], dtype=float)
            for name in ("stiffness", "stiffness_error", "tip")
        ]
        parameters = {str(k): float(v) for k, v in about["parameters"].items()}
        float(about["relative_error_estimate"])
    except BadInput:
        raise
    except (
        ValueError, OverflowError, LookupError, TypeError, AttributeError,
        RecursionError,
    ) as error:  # fmt: skip
        raise BadInput(f"{file}: damaged entry ({type(error).__name__})") from None
    K, error_matrix, tip = arrays
    if K.shape != (6, 6) or error_matrix.shape != (6, 6) or tip.shape != (3,):
        raise BadInput(f"{file}: found a matrix that is not 6 by 6, expected 6 by 6")
    if not all(np.isfinite(array).all() for array in arrays):
        raise BadInput(
            f"{file}: found a number that is not finite, expected finite numbers"
        )
    check_definite(f"{file}: stiffness", K)
    return Entry(file.stem, K, error_matrix, tip, parameters, about)


def read_compliance(path: Path | str, key: str) -> NDArray:
    """Read the compliance of an entry.

    Args:
        path: folder of the library.
        key: name of the entry.

    Returns:
        (6, 6) [rad/(N m) .. m/N] compliance.

    Raises:
        BadInput: the library or the entry does not exist, or the file is damaged.
    """
    return inverted(read_entry(path, key).stiffness)


def read_library(path: Path | str) -> list[Entry]:
    """Read all entries of a library.

    Args:
        path: folder of the library.

    Returns:
        The entries in the order of their keys.

    Raises:
        BadInput: the library does not exist, is empty, or contains a damaged entry.
    """
    path = Path(path)
    files = sorted(path.glob("*.json")) if os.path.isdir(path) else []
    if not files:
        raise BadInput(f"{path}: found no library, expected a folder of entries")
    return [_entry(file) for file in files]


def look_up(
    entries: Sequence[Entry], wanted: Mapping[str, float], family: str = ""
) -> tuple[NDArray, NDArray]:
    """Interpolate the stiffness between the entries of a grid.

    The interpolated quantities are the logarithms of the diagonal entries and the
    off-diagonal entries divided by sqrt(K_ii K_jj). They are interpolated by
    polynomials in the logarithms of the parameters, through up to four values of each
    parameter. This is accurate because a stiffness is nearly a product of powers of
    dimensions.

    Args:
        entries: entries of a full grid.
        wanted: value of each parameter. A parameter with the same value in all entries
            may be omitted.
        family: name of a family of parts given by surfaces. If empty, the grid of a
            shape or the only family is used.

    Returns:
        Stiffness, (6, 6), and its estimated error, (6, 6). The error is the change of
        the result if the farthest entry along each axis is omitted, plus the errors of
        the entries.

    Raises:
        BadInput: a parameter is unknown, missing or outside the grid, or the entries do
            not form a full grid.
    """
    entries = _grid_of(entries, family)
    names = list(entries[0].parameters)
    for name in wanted:
        if name not in names:
            raise BadInput(f'look-up: unknown parameter "{name}"{nearest(name, names)}')
    for entry in entries:
        if entry.parameters.keys() != entries[0].parameters.keys():
            raise BadInput(
                f"look-up: {entry.key} has the parameters "
                f"{', '.join(entry.parameters) or 'none'}, but {entries[0].key} has "
                f"the parameters {', '.join(names) or 'none'}; expected the same "
                "parameters in all entries of a grid"
            )
    axes = [sorted({e.parameters[name] for e in entries}) for name in names]
    single = {n: a[0] for n, a in zip(names, axes, strict=True) if len(a) == 1}
    wanted = single | dict(wanted)
    for name, axis in zip(names, axes, strict=True):
        if name not in wanted:
            raise BadInput(
                f"look-up: {name}: missing; expected a value, because it is a "
                "parameter of the grid"
            )
        if not axis[0] <= wanted[name] <= axis[-1]:
            raise BadInput(
                f"look-up: {name} = {wanted[name]:g} is outside the grid, "
                f"expected {axis[0]:g} .. {axis[-1]:g}: the stiffness is not "
                "extrapolated"
            )
    if len(entries) != np.prod([len(axis) for axis in axes]):
        raise BadInput(
            "look-up: the grid of parameters is incomplete; expected an entry for "
            "each combination of values"
        )
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


def _grid_of(entries: Sequence[Entry], family: str) -> list[Entry]:
    """Return the entries of a family or of the grid of a shape."""
    # single parts are not on a grid
    families = sorted({e.about["family"] for e in entries if e.about.get("family")})
    grid = [entry for entry in entries if "surface" not in entry.about]
    if family and family not in families:
        raise BadInput(f'look-up: no family "{family}"{nearest(family, families)}')
    if not family and not grid and len(families) > 1:
        raise BadInput(
            f"look-up: found the families {', '.join(families)}, expected the name of "
            "one"
        )
    if family or (not grid and families):
        wanted = family or families[0]
        return [entry for entry in entries if entry.about.get("family") == wanted]
    if not grid:
        raise BadInput(
            "look-up: found only single parts, expected entries on a grid of parameters"
        )
    return grid


def _interpolated(
    place: Mapping[tuple[float, ...], Entry],
    axes: Sequence[Sequence[float]],
    at: Sequence[float],
    most: Sequence[int],
) -> NDArray:
    """Interpolate by Lagrange polynomials through the nearest parameter values."""
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
