"""Convert device orientations given as quaternions or as three angles.

An orientation R transforms vectors from target axes to device axes: p_device = R
p_target.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from forcefit.inputs.errors import BadInput, quoted
from forcefit.validation.exchange.column_names import QUATERNION, Column

ROTATION_VECTOR = "rotation_vector"
ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180}
# Rotations are regarded as inverted if inverse rotations reduce the scatter below this
# fraction of its value.
_FAR_BETTER = 0.25
# [rad] Scatter above which orientations are regarded as unrelated to the commands.  The
# scatter of real machines is below 0.02 rad.
_UNRELATED = 0.2
_GROSS = 20.0  # multiple of the scatter above which a reading is excluded from the mean
# Ratio of the median length of a Gaussian vector in three dimensions to the standard
# deviation of one component.
_MEDIAN = 1.538
_ROUNDING = 1e-12  # [rad] smallest scatter, due to round-off
_UNIT_NORM = 0.01  # accepted deviation of the norm of a quaternion from 1


def orders() -> tuple[str, ...]:
    """Return the accepted values of ``orientation`` in a targets file.

    Returns:
        ``rotation_vector`` and the 24 orders of three angles.  Small letters denote
        fixed axes, and capital letters denote moving axes.
    """
    axes = [a + b + c for a in "xyz" for b in "xyz" for c in "xyz" if a != b != c]
    return (ROTATION_VECTOR, *axes, *(axis.upper() for axis in axes))


def orientation_columns(
    columns: Sequence[Column], own: Sequence[int]
) -> tuple[str, dict[str, int]]:
    """Return the columns that contain a target's orientation.

    Args:
        columns: columns of the table.
        own: indices of the target's columns.

    Returns:
        The representation (``"quaternion"``, ``"angles"`` or an empty string), and a
        mapping from each component to its column.
    """
    w = {columns[k].axis: k for k in own if columns[k].kind == "quaternion"}
    angles = {columns[k].axis: k for k in own if columns[k].kind == "angle"}
    # If there is a column W, the columns Rotation X, Y and Z contain a quaternion.
    if "w" in w:
        w = angles | w
    if set(w) >= set(QUATERNION):
        return "quaternion", {axis: w[axis] for axis in QUATERNION}
    if set(angles) == set("xyz"):
        return "angles", angles
    return "", {}


def from_quaternion(place: str, values: Sequence[float]) -> NDArray:
    """Convert a quaternion to the rotation matrix from target axes to device axes.

    Args:
        place: file and line, for messages.
        values: w, x, y, z.

    Returns:
        The rotation matrix.

    Raises:
        BadInput: the norm of the quaternion is not 1.
    """
    w, x, y, z = values
    norm = float(np.linalg.norm(values))
    if abs(norm - 1) > _UNIT_NORM:
        raise BadInput(f"{place}: found a quaternion of norm {norm:.4g}, expected 1")
    return np.asarray(Rotation.from_quat([x, y, z, w]).as_matrix())


def from_angles(
    place: str, angles: Mapping[str, float], order: str | None
) -> NDArray:  # fmt: skip
    """Convert three angles to the rotation matrix from target axes to device axes.

    Args:
        place: file and line, for messages.
        angles: [rad] angles in the order of the columns.
        order: order of the angles in the targets file, or None.

    Returns:
        The rotation matrix.

    Raises:
        BadInput: no order is declared.
    """
    if order is None:
        raise BadInput(
            f"{place}: found three angles, expected their order in the targets file: "
            f'orientation = "xyz" (fixed axes), "ZYX" (moving axes) or '
            f"{quoted(ROTATION_VECTOR)}"
        )
    if order == ROTATION_VECTOR:
        vector = [angles[axis] for axis in "xyz"]
        return np.asarray(Rotation.from_rotvec(vector).as_matrix())
    named = len(set(order.lower())) == 3
    turns = [angles[axis] for axis in order.lower()] if named else [*angles.values()]
    return np.asarray(Rotation.from_euler(order, turns).as_matrix())


@dataclass(frozen=True, eq=False)
class Turns:
    """Orientations of one target, converted to rotations of the platform.

    Attributes:
        deviation: (R, 3) [rad] rotation vector from nominal to actual orientation, base
            axes; NaN if not measured.
        mount: (3, 3) rotation matrix from target axes to platform axes.
        scatter: [rad] scatter of one component of the deviations.
    """

    deviation: NDArray
    mount: NDArray
    scatter: float


def turns_of(
    file: Path, seen: NDArray, base: NDArray, nominal: NDArray, mount: NDArray | None
) -> Turns:
    """Return the deviations of a target's orientations from their nominal values.

    Args:
        file: the targets file, for messages.
        seen: (R, 3, 3) rotation matrices from target axes to device axes; NaN if not
            measured.
        base: (3, 3) rotation matrix from device axes to base axes.
        nominal: (R, 3, 3) rotation matrices from platform axes to base axes for the
            declared robot.
        mount: rotation matrix from target axes to platform axes; None to fit it.

    Returns:
        The deviations.

    Raises:
        BadInput: the inverse rotations fit much better, or the orientations do not
            agree with the commands.
    """
    best = _turns(base @ seen, nominal, mount)
    other = _turns(base @ np.swapaxes(seen, 1, 2), nominal, mount)
    if other.scatter < _FAR_BETTER * best.scatter:
        raise BadInput(
            f"{file}: found inverted orientations: their inverses fit much "
            f"better (scatter {other.scatter:.2g} rad instead of "
            f"{best.scatter:.2g} rad); expected the orientation of the target's "
            "axes relative to the device's axes"
        )
    if best.scatter > _UNRELATED:
        raise BadInput(
            f"{file}: found orientations that do not follow the commands (scatter "
            f"{best.scatter:.2g} rad); expected the right order and unit of the "
            "angles, the right order of a quaternion's columns, and the right "
            "[rotations]"
        )
    return best


def _turns(read: NDArray, nominal: NDArray, mount: NDArray | None) -> Turns:
    """Return the deviations for a declared or fitted orientation of the target."""
    taken = np.isfinite(read).all(axis=(1, 2))
    seen = Rotation.from_matrix(np.swapaxes(nominal[taken], 1, 2) @ read[taken])
    if mount is None:
        middle = seen.mean()
        near = (middle.inv() * seen).magnitude()
        kept = near <= _GROSS * np.median(near) + _ROUNDING
        mount = seen[kept].mean().as_matrix()
    actual = read[taken] @ mount.T
    gap = Rotation.from_matrix(actual @ np.swapaxes(nominal[taken], 1, 2)).as_rotvec()
    deviation = np.full((len(read), 3), np.nan)
    deviation[taken] = gap
    scatter = float(np.median(np.linalg.norm(gap, axis=1))) / _MEDIAN + _ROUNDING
    return Turns(deviation, mount, scatter)
