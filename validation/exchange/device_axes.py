"""Check the length unit and the axes of a device export.

A wrong unit multiplies all distances by the same factor, and left-handed axes mirror
the readings.  Such files are rejected.  They are not corrected, because a wrong setting
of the device may also affect data that cannot be checked.

Sources:
    Umeyama (1991), Least-squares estimation of transformation parameters between two
    point patterns, IEEE Trans. PAMI 13, 376: scale, and the sign of the determinant.
"""

from collections.abc import Mapping
from itertools import combinations, permutations, product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.errors import BadInput
from forcefit.validation.exchange.device_frame import robust_frame, scatter_of
from forcefit.validation.exchange.reading import LENGTHS

_UNITS = {**LENGTHS, "ft": 0.3048}
# The axes or units are regarded as wrong if a correction reduces the scatter below this
# fraction of its value.
_FAR_BETTER = 0.25
_SCALED = 0.02  # largest relative scatter of distance ratios for a wrong unit
# Accepted relative error of the estimated ratio of two units.
_UNIT = 0.05
# Number of following readings to which the distances from a reading are computed.
_PAIRED = 10
# Largest accepted difference between measured and declared distance of two targets,
# relative to the declared distance.
_APART = 0.1
# Reversal of the y axis. The reversal of a different axis would differ only by a
# rotation.
_MIRRORED = np.array([1.0, -1.0, 1.0])


def check_axes(
    file: Path, measured: NDArray, nominal: NDArray, known: bool
) -> None:  # fmt: skip
    """Reject lengths in a wrong unit, mirrored axes, and exchanged axes.

    Args:
        file: the targets file, for messages.
        measured: (N, 3) [m] readings, device axes.
        nominal: (N, 3) [m] nominal positions, base axes.
        known: whether the device axes are declared equal to the base axes.

    Raises:
        BadInput: the readings fit much better with another unit or other axes.
    """
    scatter = _scatter(measured, nominal, known)
    factor, meant = _units_of(_factor(measured, nominal, known))
    for mirror in (np.ones(3), _MIRRORED) if meant else ():
        rescaled = _scatter(factor * measured * mirror, nominal, known)
        if rescaled < _FAR_BETTER * scatter:
            raise BadInput(
                f"{file}: unit: the readings fit much better if multiplied by "
                f"{factor:.4g}, {meant} (scatter {rescaled:.2g} m instead of "
                f"{scatter:.2g} m); declare the correct unit"
            )
    if known:
        _check_known_axes(file, measured, nominal, scatter)
        return
    mirrored = _scatter(measured * _MIRRORED, nominal, known)
    if mirrored < _FAR_BETTER * scatter:
        raise BadInput(
            f"{file}: found left-handed axes of the device: the readings fit "
            "much better with one axis reversed, such as y to -y (scatter "
            f"{mirrored:.2g} m instead of {scatter:.2g} m); export the readings "
            "in right-handed axes"
        )


def check_targets(
    file: Path, places: Mapping[str, NDArray], measured: NDArray
) -> list[str]:
    """Compare the measured distances between targets with the declared distances.

    Args:
        file: the targets file, for messages.
        places: mapping from the name of each target to its declared position (3,) [m],
            platform axes.
        measured: (R, T, 3) [m] positions of the targets in each row; NaN if not read.

    Returns:
        Remarks about pairs of targets with different measured and declared distances.

    Raises:
        BadInput: all distances differ by the same factor.
    """
    names, ratios, remarks = list(places), [], []
    for i, j in combinations(range(len(names)), 2):
        apart = np.linalg.norm(measured[:, i] - measured[:, j], axis=1)
        apart = apart[np.isfinite(apart)]
        declared = float(np.linalg.norm(places[names[i]] - places[names[j]]))
        if not len(apart) or not declared > 0:
            continue
        ratios.append(apart / declared)
        if np.median(np.abs(apart - declared)) > _APART * declared:
            remarks.append(
                f"the measured distance of {names[i]} and {names[j]} is "
                f"{apart.min():.3g} .. {apart.max():.3g} m, declared "
                f"{declared:.3g} m"
            )
    if remarks:
        ratio = np.concatenate(ratios)
        factor = float(np.median(ratio))
        if np.median(np.abs(ratio / factor - 1)) < _SCALED:
            _, meant = _units_of(factor)
            raise BadInput(
                f"{file}: targets: {remarks[0]}: all distances are {factor:.4g} "
                f"times as large as declared{', ' if meant else ''}{meant}; "
                "expected target positions in m"
            )
    return remarks


def _units_of(factor: float) -> tuple[float, str]:
    """Return the ratio of two units that is near a factor, and its description.

    If there is no such ratio, 1 and an empty string are returned.
    """
    found = [
        (_UNITS[b] / _UNITS[a], f'probably because "{b}" was read as "{a}"', a, b)
        for a, b in permutations(_UNITS, 2)
        if abs(factor * _UNITS[a] / _UNITS[b] - 1) < _UNIT and _UNITS[a] != _UNITS[b]
    ]
    likely = min(found, key=lambda f: ("mm" not in f, "um" in f), default=(1.0, ""))
    return likely[0], likely[1]


def _factor(measured: NDArray, nominal: NDArray, known: bool) -> float:
    """Return a robust estimate of the ratio of nominal to measured distances."""
    if known:
        pairs = [(measured, nominal)]
    # Distances between readings do not depend on the device pose.
    else:
        shifts = range(1, min(len(measured), _PAIRED))
        pairs = [
            (measured - np.roll(measured, k, axis=0), nominal - np.roll(nominal, k, 0))
            for k in shifts
        ]
    lengths = [np.linalg.norm(pair, axis=2) for pair in pairs]
    read, wanted = np.concatenate(lengths, axis=1)
    apart = read > 0
    return float(np.median(wanted[apart] / read[apart])) if apart.any() else 1.0


def _scatter(measured: NDArray, nominal: NDArray, known: bool) -> float:
    """Return the scatter [m] of the readings, with the fitted or known device frame."""
    if known:
        return scatter_of(np.linalg.norm(measured - nominal, axis=1))
    return robust_frame(measured, nominal)[1]


def _check_known_axes(
    file: Path, measured: NDArray, nominal: NDArray, scatter: float
) -> None:
    """Reject device axes that are exchanged or reversed relative to the base."""
    best, found = scatter, ""
    for order, signs in product(permutations(range(3)), product((1, -1), repeat=3)):
        tried = _scatter(measured[:, list(order)] * signs, nominal, known=True)
        if tried < best:
            best = tried
            found = ", ".join(
                f"{axis} is the device's {'-' if sign < 0 else ''}{'xyz'[k]}"
                for axis, k, sign in zip("xyz", order, signs, strict=True)
                if (sign, "xyz"[k]) != (1, axis)
            )
    if best < _FAR_BETTER * scatter:
        raise BadInput(
            f'{file}: registration = "known": the readings fit much better if '
            f"{found} (scatter {best:.2g} m instead of {scatter:.2g} m); "
            'correct the axes or set registration = "unknown"'
        )
