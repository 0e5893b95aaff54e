"""Joint clearances, eqs (1)-(5): bounds of small screws, each of which is a cone.

======  ====================  =======  ==========================================
symbol  code                  shape    meaning
======  ====================  =======  ==========================================
c-bar   ``clearance_bounds``  (n, 5)   [RXY RZ TXY TZ TXYZ], 0 rigid, inf free
======  ====================  =======  ==========================================

The first four bounds are those of the paper.  The last bound, for (TX, TY, TZ), is a
ball joint's clearance in its socket and replaces TXY and TZ.  The value is NaN for a
bound that the joint does not use.

The free motion of a passive joint is treated as a clearance in one of these directions.
This clearance is unbounded, or has the bound given in the file.
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import Clearance, Frame, Robot

# components of the screw [RX RY RZ TX TY TZ] that each bound limits
CONES = ((0, 1), (2,), (3, 4), (5,), (3, 4, 5))
# keys of the five bounds in robot files
BOUNDS = ("tilt", "spin", "radial", "axial", "ball")
_BALL = BOUNDS.index("ball")
# index of the bound of each screw component, for joints without the bound ``ball``
_BOUND_OF_COMPONENT = (0, 0, 1, 2, 2, 3)


def clearance_bounds(robot: Robot, own_axes_free: bool = False) -> NDArray:
    """Return the bounds of every joint's clearance.

    Args:
        robot: robot of n frames.
        own_axes_free: whether passive joints with stiffness move freely about or along
            their z axis.  If not, only the spring moves there, and ``spin``, if given,
            is a clearance in series with the spring.

    Returns:
        (n, 5) [rad, rad, m, m, m] for [RXY RZ TXY TZ TXYZ]: 0 is rigid, inf is free,
        NaN means that the joint does not have this bound.
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
    """Return the (n, 6) bounds of the screw components, from the bounds (n, 5)."""
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
    """Return the index of the bound of a passive joint's motion; None for a spring."""
    if not frame.passive or frame.compliant:
        return None
    return 3 if frame.joint == "prismatic" else 1


def scales_with_margin(robot: Robot) -> NDArray:
    """Return (n, 5) bool: True for clearances, False for limits of free motions."""
    scaled = np.ones((len(robot.frames), len(BOUNDS)), dtype=bool)
    for i, frame in enumerate(robot.frames):
        own = own_cone(frame)
        if own is not None:
            scaled[i, own] = False
    return scaled


def has_bounded_motion(robot: Robot) -> bool:
    """Return whether the motion of a passive joint is bounded."""
    own = ~scales_with_margin(robot)
    return bool(np.isfinite(clearance_bounds(robot)[own]).any())


def clearance_components(robot: Robot, screws: NDArray) -> NDArray:
    """Return the components of clearance screws that the bounds limit.

    Component TZ of a helical joint is the translation relative to its thread,
    TZ - h RZ.  All other components are those of the screw.

    Args:
        robot: robot of n frames.
        screws: (..., n, 6) [rad, m] clearances and motions of passive joints.

    Returns:
        (..., n, 6) [rad, m]; the given array if there are no helical joints.
    """
    leads = np.array([frame.lead for frame in robot.frames])
    if not leads.any():
        return screws
    components = screws.copy()
    components[..., 5] -= leads * screws[..., 2]
    return components


def clearance_excess(screws: NDArray, bounds: NDArray) -> NDArray:
    """Return the largest relative excess of clearance screws over cones, eqs (2)-(5).

    Args:
        screws: (..., n, 6) [rad, m] clearance screws.
        bounds: (n, 5) [rad, rad, m, m, m], see :func:`clearance_bounds`.

    Returns:
        (...) [-] largest value of size / bound - 1 over all positive finite bounds; for
        a zero bound, the size in rad or m; at least 0.
    """
    sizes = np.stack(
        [np.linalg.norm(screws[..., list(rows)], axis=-1) for rows in CONES], axis=-1
    )
    limited = np.isfinite(bounds)
    where_rigid = np.where(limited & (bounds == 0.0), sizes, 0.0)
    limited = np.broadcast_to(limited & (bounds > 0.0), sizes.shape)
    with np.errstate(over="ignore"):  # division by a very small bound
        excess = np.divide(sizes, bounds, where=limited, out=np.ones_like(sizes)) - 1.0
    worst = np.maximum(excess, where_rigid).max(axis=(-2, -1))
    return np.maximum(0.0, worst)
