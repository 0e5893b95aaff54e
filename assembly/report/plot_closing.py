"""Animation of a robot from open loops to the assembled state.

In the first picture, the loops are open due to geometric errors. Deformations and joint
motions increase from zero to their values in the minimum-energy solution (22).
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.linear.energy import Assembly
from forcefit.assembly.report.plot import (
    DisplacedBodies,
    add_bodies,
    displaced_bodies,
    fill_window,
    readable_factor,
    robot_plotter,
)
from forcefit.inputs.errors import BadInput

_STEPS = 24  # number of steps of the animation
_STEP, _OPEN, _CLOSED = 60, 900, 1800  # [ms] duration of inner, first and last picture
_WINDOW = (720, 540)  # [pixels] size of a picture


def closing_gaps(assembly: Assembly, closing: float) -> NDArray:
    """Return the gap between the two frames of each closure.

    Args:
        assembly: assembly of a robot with k closures.
        closing: fraction of the deformations and joint motions, 0 to 1.

    Returns:
        Vectors from the first to the second frame in base axes, (k, 3) [m].
    """
    robot = assembly.posture.robot
    moved = displaced_bodies(assembly, closing).end_screws[:, 3:]
    gaps = [moved[robot.index(b)] - moved[robot.index(a)] for a, b in robot.closures]
    return np.reshape(gaps, (-1, 3))


def closing_pictures(
    assembly: Assembly, exaggeration: float | None = None
) -> Iterator[tuple[NDArray, int]]:
    """Yield the pictures of the animation.

    Args:
        assembly: assembly of the robot.
        exaggeration: factor on all displacements; by default they are clearly visible.

    Yields:
        A picture, (rows, columns, 3) with values from 0 to 255, and its duration [ms].

    Raises:
        BadInput: all loops are closed without deformation.
    """
    if not np.any(np.abs(closing_gaps(assembly, 0.0)) > 1e-12):
        raise BadInput(
            f"--closing: {assembly.posture.robot.name} has no open closure; expected "
            "geometric errors in a loop"
        )
    ends = [displaced_bodies(assembly, share) for share in (0.0, 1.0)]
    size = float(np.ptp(ends[0].ends, axis=0).max())
    factor = exaggeration or min(readable_factor(bodies, size) for bodies in ends)
    plotter = robot_plotter(assembly, factor, True)
    plotter.window_size = _WINDOW
    add_bodies(plotter, assembly, ends[0], factor, size)
    fill_window(plotter)
    for k in range(_STEPS + 1):
        share = (1 - np.cos(np.pi * k / _STEPS)) / 2
        _draw(plotter, assembly, displaced_bodies(assembly, share), factor, size)
        plotter.add_text(
            f"closing {100 * share:.0f} %, displacements x {factor:g}; "
            "pink: open closures; grey: nominal",
            font_size=9, name="caption", render=False,
        )  # fmt: skip
        plotter.render()
        duration = {0: _OPEN, _STEPS: _CLOSED}.get(k, _STEP)
        yield plotter.screenshot(return_img=True), duration
    plotter.close()


def _draw(
    plotter: Any, assembly: Assembly, bodies: DisplacedBodies, factor: float,
    size: float,
) -> None:  # fmt: skip
    """Draw the bodies, and a line in the gap of each open loop."""
    import pyvista

    add_bodies(plotter, assembly, bodies, factor, size)
    robot = assembly.posture.robot
    shown = bodies.ends + factor * bodies.end_screws[:, 3:]
    for k, (a, b) in enumerate(robot.closures):
        start, end = shown[robot.index(a)], shown[robot.index(b)]
        plotter.remove_actor(f"gap {k}", reset_camera=False, render=False)
        if np.linalg.norm(end - start) > 1e-3 * size:
            gap = pyvista.Line(start, end).tube(radius=0.009 * size)
            plotter.add_mesh(
                gap, color="magenta", name=f"gap {k}", reset_camera=False, render=False
            )
