"""Stiffness matrix of a free body with two interfaces.

======  ============  =======================================================
symbol  shape         meaning
======  ============  =======================================================
K12     (12, 12)      stiffness matrix of the screws [R T] of base and tip
K       (6, 6)        K_E: block of K12 for the tip, base clamped
X       (6, 6)        rigid motion from base to tip: K12 [s; X s] = 0
======  ============  =======================================================
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.inputs.errors import BadInput
from forcefit.stiffness.link import LinkStiffness, check_definite, inverted
from forcefit.stiffness.screws import screw_map, skew

# largest accepted residual wrench of a rigid motion, relative to the entries of K12;
# files with seven digits cause smaller residuals
_BALANCED = 1e-5
_FARTHEST = 1e6  # [m] largest accepted distance between base and tip


def both_ends(stiffness: ArrayLike, base_from_tip: ArrayLike) -> NDArray:
    """Compute the stiffness matrix K12 of both interfaces from K_E.

    Args:
        stiffness: (6, 6) K_E at the tip.
        base_from_tip: (3,) [m] vector from tip to base.

    Returns:
        (12, 12) matrix K12, base before tip, rotations before translations.
    """
    K = np.asarray(stiffness, dtype=float)
    X = screw_map(base_from_tip)
    both = np.hstack([-X, np.eye(6)])
    return np.asarray(both.T @ K @ both)


def link_of_both_ends(
    K12: ArrayLike,
    who: str,
    base: ArrayLike | None = None,
    tip: ArrayLike | None = None,
) -> LinkStiffness:
    """Create a link from the stiffness matrix of its two interfaces.

    Args:
        K12: (12, 12) matrix in SI units, base before tip, rotations before
            translations.
        who: name of the file, for error messages.
        base: (3,) [m] reference point of the base. If None, its position relative to
            the tip is computed from the matrix.
        tip: (3,) [m] reference point of the tip; None if ``base`` is None.

    Returns:
        The link. If the points are unknown, the tip is at the origin.

    Raises:
        BadInput: K_E is not positive definite, or K12 is not the stiffness matrix of a
            free body.
    """
    K12 = np.asarray(K12, dtype=float)
    K = K12[6:, 6:]
    check_definite(f"{who}: the block of the tip", K)
    X = -inverted(K) @ K12[6:, :6]
    arm = X[3:, :3]
    own_offset = np.array([arm[2, 1] - arm[1, 2], arm[0, 2] - arm[2, 0],
                      arm[1, 0] - arm[0, 1]]) / 2  # fmt: skip
    offset = own_offset
    if base is not None and tip is not None:
        offset = np.asarray(base, dtype=float) - np.asarray(tip, dtype=float)
    if not (np.abs(offset) < _FARTHEST).all():
        raise BadInput(
            f"{who}: the matrix implies a distance of {np.abs(offset).max():.3g} m "
            "between base and tip; check whether the body is clamped elsewhere, and "
            "the order and units of the degrees of freedom"
        )
    ideal = both_ends(K, offset)
    size = np.sqrt(np.abs(np.diag(ideal)))
    gap = np.abs(K12 - ideal) / np.outer(size, size)
    if not gap.max() < _BALANCED:
        i, j = np.unravel_index(int(np.argmax(gap)), gap.shape)
        raise BadInput(
            f"{who}: the wrenches of the two interfaces do not balance: found "
            f"[{i + 1}, {j + 1}] = {K12[i, j]:.6e}, expected {ideal[i, j]:.6e} for a "
            f"free body whose base is {offset[0]:.6g}, {offset[1]:.6g}, "
            f"{offset[2]:.6g} m from its tip; check whether the body is clamped "
            "elsewhere, and the order and units of the degrees of freedom"
        )
    at = np.zeros(3) if tip is None else np.asarray(tip, dtype=float)
    return LinkStiffness(who, inverted(K), tip=at, base=at + offset)


def mass_of_both_ends(
    M12: ArrayLike, offset: ArrayLike
) -> tuple[float, NDArray, NDArray]:
    """Compute mass, centre of mass and inertia from the mass matrix of two interfaces.

    Args:
        M12: (12, 12) mass matrix in SI units, in the order of K12.
        offset: (3,) [m] vector from tip to base.

    Returns:
        Mass [kg]; centre of mass relative to the tip, (3,) [m]; and inertia about the
        centre of mass, (3, 3) [kg m^2].

    Raises:
        BadInput: the mass is not positive.
    """
    rigid = np.vstack([screw_map(-np.asarray(offset, dtype=float)), np.eye(6)])
    M = rigid.T @ np.asarray(M12, dtype=float) @ rigid
    mass = float(np.trace(M[3:, 3:]) / 3)
    if not mass > 0:
        raise BadInput(f"the mass matrix: found a mass of {mass:g} kg, expected > 0")
    # the velocity of the centre c is t + w x c, so the block of t and w is -m [c]x
    arm = -M[3:, :3] / mass
    centre = np.array([arm[2, 1] - arm[1, 2], arm[0, 2] - arm[2, 0],
                       arm[1, 0] - arm[0, 1]]) / 2  # fmt: skip
    J = M[:3, :3] + mass * skew(centre) @ skew(centre)
    return mass, centre, (J + J.T) / 2
