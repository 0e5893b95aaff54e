"""Joint clearances, eqs (1)-(5): second-order cone bounds on small screws.

======  ====================  =======  ==========================================
symbol  code                  shape    meaning
======  ====================  =======  ==========================================
c-bar   ``clearance_bounds``  (n, 5)   [RXY RZ TXY TZ TXYZ], 0 rigid, inf free
======  ====================  =======  ==========================================

The first four bounds are those of the paper.  TXYZ is the clearance of a ball joint in
its socket, limits the norm of (TX, TY, TZ), and replaces TXY and TZ.  Bounds that a
joint does not use are NaN.

The motion of a passive joint is treated as a clearance that is unbounded unless the
robot file contains a bound.
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import Clearance, Frame, Robot

# components of the screw [RX RY RZ TX TY TZ] limited by each bound
CONES = ((0, 1), (2,), (3, 4), (5,), (3, 4, 5))
# keys of the five bounds in robot files
BOUNDS = ("tilt", "spin", "radial", "axial", "ball")
_BALL = BOUNDS.index("ball")
# index of the bound on each screw component, for joints without the bound ``ball``
_BOUND_OF_COMPONENT = (0, 0, 1, 2, 2, 3)


def clearance_bounds(robot: Robot, own_axes_free: bool = False) -> NDArray:
    """Return the clearance bounds of all joints.

    Args:
        robot: robot with n frames.
        own_axes_free: whether passive joints with stiffness move freely about or along
            their z axis. If False, only the spring deforms in this direction, and a
            given bound ``spin`` is a clearance in series with the spring.

    Returns:
        Bounds (n, 5) [rad, rad, m, m, m] for [RXY RZ TXY TZ TXYZ]: 0 for rigid, inf for
        free, NaN for bounds that the joint does not use.
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
    """Convert clearance bounds (n, 5) to bounds (n, 6) on the screw components."""
    components = bounds[:, list(_BOUND_OF_COMPONENT)]
    return np.where(np.isnan(components), bounds[:, [_BALL]], components)


def bound_name(columns: NDArray) -> str:
    """Return the key of the bound of a cone, for example ``"tilt"``.

    Args:
        columns: matrix (6n, k) that maps the k coordinates of the cone to the screws of
            all frames; see :class:`forcefit.assembly.linear.closure.VirtualJoints`.

    Returns:
        One of :data:`BOUNDS`.
    """
    rows = np.flatnonzero(columns.any(axis=1)) % 6
    return BOUNDS[CONES.index(tuple(rows.tolist()))]


def own_cone(frame: Frame) -> int | None:
    """Return the index of the bound on a passive joint's free motion, or None."""
    if not frame.passive or frame.compliant:
        return None
    return 3 if frame.joint == "prismatic" else 1


def scales_with_margin(robot: Robot) -> NDArray:
    """Return True for clearances and False for motion limits, (n, 5)."""
    scaled = np.ones((len(robot.frames), len(BOUNDS)), dtype=bool)
    for i, frame in enumerate(robot.frames):
        own = own_cone(frame)
        if own is not None:
            scaled[i, own] = False
    return scaled


def has_bounded_motion(robot: Robot) -> bool:
    """Return whether the motion of at least one passive joint is bounded."""
    own = ~scales_with_margin(robot)
    return bool(np.isfinite(clearance_bounds(robot)[own]).any())


def clearance_components(robot: Robot, screws: NDArray) -> NDArray:
    """Return the components of clearance screws to which the bounds apply.

    For a helical joint, component TZ is the translation TZ - h RZ relative to the
    thread. All other components do not change.

    Args:
        robot: robot with n frames.
        screws: clearances and motions of passive joints (..., n, 6) [rad, m].

    Returns:
        Components (..., n, 6) [rad, m]; the input array if there are no helical joints.
    """
    leads = np.array([frame.lead for frame in robot.frames])
    if not leads.any():
        return screws
    components = screws.copy()
    components[..., 5] -= leads * screws[..., 2]
    return components


def clearance_excess(screws: NDArray, bounds: NDArray) -> NDArray:
    """Return the largest relative violation of the clearance bounds, eqs (2)-(5).

    Args:
        screws: clearance screws (..., n, 6) [rad, m].
        bounds: bounds (n, 5) [rad, rad, m, m, m]; see :func:`clearance_bounds`.

    Returns:
        Nonnegative violation (...) [-]: maximum of magnitude / bound - 1 over all
        finite bounds.  For a zero bound, the magnitude in rad or m is used instead.
    """
    sizes = np.stack(
        [np.linalg.norm(screws[..., list(rows)], axis=-1) for rows in CONES], axis=-1
    )
    limited = np.isfinite(bounds)
    where_rigid = np.where(limited & (bounds == 0.0), sizes, 0.0)
    limited = np.broadcast_to(limited & (bounds > 0.0), sizes.shape)
    with np.errstate(over="ignore"):  # division by a very small bound can overflow
        excess = np.divide(sizes, bounds, where=limited, out=np.ones_like(sizes)) - 1.0
    worst = np.maximum(excess, where_rigid).max(axis=(-2, -1))
    return np.maximum(0.0, worst)
