"""Joint clearances, eqs (1)-(5): bounds on small screws, each a cone.

======  ====================  =======  ==========================================
symbol  code                  shape    meaning
======  ====================  =======  ==========================================
c-bar   ``clearance_bounds``  (n, 5)   [RXY RZ TXY TZ TXYZ], 0 rigid, inf free
======  ====================  =======  ==========================================

Four of them are the paper's.  The last one, for (TX, TY, TZ), is a ball in its socket:
it takes the place of TXY and TZ.  A bound that a joint does not have is NaN.

The free motion of a passive joint is one of these directions without a bound, or with
the bound in the file.  So a joint's own motion needs no separate treatment.
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import Clearance, Frame, Robot

# components of the screw that each bound limits
CONES = ((0, 1), (2,), (3, 4), (5,), (3, 4, 5))
BOUNDS = ("tilt", "spin", "radial", "axial", "ball")  # keys of the bounds, by cone
_BALL = BOUNDS.index("ball")
_BOUND_OF_COMPONENT = (0, 0, 1, 2, 2, 3)  # without a ball


def clearance_bounds(robot: Robot, own_axes_free: bool = False) -> NDArray:
    """Return the bounds of every joint's clearance.

    Args:
        robot: of n frames.
        own_axes_free: whether passive joints with stiffness move freely about or along
            their own z; else only the spring moves there (and ``spin``, if given, is a
            clearance in series).

    Returns:
        (n, 5) [rad, rad, m, m, m] for [RXY RZ TXY TZ TXYZ]: 0 is rigid, inf is free,
        NaN is no bound of this joint.
    """
    bounds = np.zeros((len(robot.frames), len(BOUNDS)))
    for i, frame in enumerate(robot.frames):
        clearance = frame.clearance or Clearance()
        bounds[i] = [getattr(clearance, key) or 0.0 for key in BOUNDS]
        bounds[i, [_BALL] if clearance.ball is None else [2, 3]] = np.nan
        own = own_cone(frame)
        if own is not None:
            given = getattr(clearance, BOUNDS[own])
            bounds[i, own] = np.inf if given is None else given
        elif frame.compliant and own_axes_free:
            bounds[i, 3 if frame.joint == "prismatic" else 1] = np.inf
    return bounds


def component_bounds(bounds: NDArray) -> NDArray:
    """Return the (n, 6) bound of each component of a screw, from bounds (n, 5)."""
    components = bounds[:, list(_BOUND_OF_COMPONENT)]
    return np.where(np.isnan(components), bounds[:, [_BALL]], components)


def bound_name(columns: NDArray) -> str:
    """Return the key of the bound of a cone, such as ``"tilt"``.

    Args:
        columns: (6n, 1 to 3) columns of the cone, see
            :class:`forcefit.assembly.linear.closure.VirtualJoints`.

    Returns:
        One of :data:`BOUNDS`.
    """
    rows = np.flatnonzero(columns.any(axis=1)) % 6
    return BOUNDS[CONES.index(tuple(rows.tolist()))]


def own_cone(frame: Frame) -> int | None:
    """Return the bound that limits a passive joint's own motion; None for a spring."""
    if not frame.passive or frame.compliant:
        return None
    return 3 if frame.joint == "prismatic" else 1


def scales_with_margin(robot: Robot) -> NDArray:
    """Return (n, 5) bool: bounds of clearances, not the range of a passive joint."""
    scaled = np.ones((len(robot.frames), len(BOUNDS)), dtype=bool)
    for i, frame in enumerate(robot.frames):
        own = own_cone(frame)
        if own is not None:
            scaled[i, own] = False
    return scaled


def has_bounded_motion(robot: Robot) -> bool:
    """Return whether a passive joint's own motion has a bound."""
    own = ~scales_with_margin(robot)
    return bool(np.isfinite(clearance_bounds(robot)[own]).any())


def clearance_components(robot: Robot, screws: NDArray) -> NDArray:
    """Return the components of clearance screws that bounds limit.

    Component TZ of a helical joint is the translation relative to its thread,
    TZ - h RZ; other components are those of the screw.

    Args:
        robot: of n frames.
        screws: (..., n, 6) [rad, m] clearances and motions of passive joints.

    Returns:
        (..., n, 6) [rad, m]; the same object without helical joints.
    """
    leads = np.array([frame.lead for frame in robot.frames])
    if not leads.any():
        return screws
    components = screws.copy()
    components[..., 5] -= leads * screws[..., 2]
    return components


def clearance_excess(screws: NDArray, bounds: NDArray) -> NDArray:
    """Return the largest excess of a clearance screw over its cone, eqs (2)-(5).

    Args:
        screws: (..., n, 6) [rad, m].
        bounds: (n, 5) [rad, rad, m, m, m], see :func:`clearance_bounds`.

    Returns:
        (...) [-] largest of size / bound - 1 over the bounds that are positive and
        finite, and of size / 1 rad or m where the bound is zero; at least 0.
    """
    sizes = np.stack(
        [np.linalg.norm(screws[..., list(rows)], axis=-1) for rows in CONES], axis=-1
    )
    limited = np.isfinite(bounds)
    where_rigid = np.where(limited & (bounds == 0.0), sizes, 0.0)
    limited = np.broadcast_to(limited & (bounds > 0.0), sizes.shape)
    with np.errstate(over="ignore"):  # by a very small bound
        excess = np.divide(sizes, bounds, where=limited, out=np.ones_like(sizes)) - 1.0
    worst = np.maximum(excess, where_rigid).max(axis=(-2, -1))
    return np.maximum(0.0, worst)
