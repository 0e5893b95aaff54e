"""3D plots of a deformed robot and of its possible platform errors."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exact.exact import ExactAssembly
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import Assembly
from forcefit.assembly.model.contact_closures import contact_frames
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.report.error_body import ErrorBody, possible_errors
from forcefit.stiffness.screws import rotation_matrix, rotation_vector, screw_map

_SHORT = 1e-9  # [m] length below which a body is not drawn


@dataclass(frozen=True, eq=False)
class DisplacedBodies:
    """Nominal positions and displacements of the bodies of an assembly.

    Attributes:
        starts: (n, 3) [m] nominal start of each body, in base axes.
        ends: (n, 3) [m] nominal end of each body, in base axes.
        start_screws: (n, 6) [rad, m] displacement of the start.
        end_screws: (n, 6) [rad, m] displacement of the end.
        bends: (n, 3) [rad] elastic rotation of the end relative to the start.
    """

    starts: NDArray
    ends: NDArray
    start_screws: NDArray
    end_screws: NDArray
    bends: NDArray


def plot_assembly(
    assembly: Assembly,
    exaggeration: float | None = None,
    errors: str | None = None,
    assumption: str = "budget",
    off_screen: bool = True,
) -> Any:
    """Plot an assembled robot, and optionally its possible platform errors.

    Args:
        assembly: assembly of the robot.
        exaggeration: factor on all displacements; None to choose it automatically.
        errors: set of errors to draw: ``"translation"``, ``"rotation"`` or None.
        assumption: assumption of problem (27) for the set of errors.
        off_screen: True to suppress the window.

    Returns:
        A pyvista plotter.

    Raises:
        BadInput: the errors are unbounded because the platform moves freely.
        SolverFailed: the cone solver failed for the set of errors.
    """
    plotter = robot_plotter(assembly, exaggeration, off_screen)
    if errors is not None:
        body = possible_errors(assembly, errors, assumption)
        size = 0.15 * float(np.ptp(assembly.posture.transforms[:, :3, 3], axis=0).max())
        add_error_body(
            plotter, body, assembly.posture.platform[:3, 3], size, assumption
        )
        fill_window(plotter)
    return plotter


def robot_plotter(
    assembly: Assembly, exaggeration: float | None = None, off_screen: bool = True
) -> Any:
    """Plot the nominal robot (grey) and the deformed robot (coloured).

    Args:
        assembly: assembly of the robot.
        exaggeration: factor on all displacements; None for the result of
            :func:`readable_factor`.
        off_screen: True to suppress the window.

    Returns:
        A pyvista plotter.
    """
    import pyvista
    from vtkmodules.vtkCommonCore import vtkLogger

    # Without a display, VTK prints messages on stderr.
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    bodies = displaced_bodies(assembly)
    size = float(np.ptp(bodies.ends, axis=0).max()) or 1.0
    exaggeration_factor = exaggeration or readable_factor(bodies, size)
    plotter = pyvista.Plotter(off_screen=off_screen, window_size=(1100, 800))
    for i in _drawn_rows(assembly.posture.robot, bodies):
        grey = pyvista.Line(bodies.starts[i], bodies.ends[i]).tube(radius=0.005 * size)
        plotter.add_mesh(grey, color="lightgrey")
    add_bodies(plotter, assembly, bodies, exaggeration_factor, size)
    _add_joint_axes(plotter, assembly.posture, size)
    caption = (
        f"displacements x {exaggeration_factor:g}; red: elastic links; grey: nominal; "
        "axes of joints orange: driven, black: passive"
    )
    plotter.add_text(caption, font_size=9, name="caption")
    plotter.add_axes()
    plotter.view_vector((0.55, -1.0, 0.35))
    fill_window(plotter)
    return plotter


def add_bodies(
    plotter: Any, assembly: Assembly, bodies: DisplacedBodies, factor: float,
    size: float,
) -> None:  # fmt: skip
    """Draw displaced bodies, and remove those drawn before.

    Args:
        plotter: pyvista plotter.
        assembly: assembly of the robot.
        bodies: result of :func:`displaced_bodies`.
        factor: factor on all displacements.
        size: [m] size of the robot.
    """
    import pyvista

    robot = assembly.posture.robot
    for i in _drawn_rows(robot, bodies):
        frame, line = robot.frames[i], pyvista.Spline(_shape(bodies, i, factor), 40)
        plotter.add_mesh(
            line.tube(radius=0.008 * size), name=f"body {frame.name}",
            color="crimson" if frame.link else "steelblue", reset_camera=False,
            render=False,
        )  # fmt: skip


def _drawn_rows(robot: Robot, bodies: DisplacedBodies) -> list[int]:
    """Return the indices of the bodies to draw."""
    lengths = np.linalg.norm(bodies.ends - bodies.starts, axis=1)
    contacts = contact_frames(robot)
    return [
        i for i, frame in enumerate(robot.frames)
        if lengths[i] >= _SHORT and frame.name not in contacts
    ]  # fmt: skip


def _add_joint_axes(plotter: Any, posture: Posture, size: float) -> None:
    """Draw short rods along the nominal joint axes."""
    import pyvista

    for frame, T in zip(posture.robot.frames, posture.transforms, strict=True):
        if frame.joint == "fixed":
            continue
        half = 0.05 * size * T[:3, 2]
        rod = pyvista.Line(T[:3, 3] - half, T[:3, 3] + half).tube(radius=0.004 * size)
        plotter.add_mesh(rod, color="darkorange" if frame.actuated else "#202020")


def fill_window(plotter: Any) -> None:
    """Move the camera so that the scene fills the window."""
    # fraction of the window without captions
    camera, share = plotter.camera, 0.85
    low, high = np.reshape(plotter.bounds, (3, 2)).T
    corners = np.array([[(low, high)[b][c] for c, b in enumerate(bits)]
                        for bits in np.ndindex(2, 2, 2)])  # fmt: skip
    plotter.reset_camera()
    width, height = plotter.window_size
    matrix = camera.GetCompositeProjectionTransformMatrix(width / height, -1, 1)
    view = np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
    seen = np.column_stack([corners, np.ones(8)]) @ view.T
    camera.zoom(share / np.abs(seen[:, :2] / seen[:, 3:]).max())


def add_error_body(
    plotter: Any, body: ErrorBody, origin: NDArray, size: float, assumption: str
) -> None:
    """Draw a magnified set of platform errors.

    Args:
        plotter: result of :func:`robot_plotter`.
        body: set of errors.
        origin: (3,) [m] position of a zero error in the plot.
        size: [m] size of the largest error in the plot.
        assumption: assumption of problem (27), for the caption.
    """
    import pyvista

    largest = float(np.linalg.norm(body.points, axis=1).max()) or 1.0
    shown = origin + body.points * (size / largest)
    solid = pyvista.PolyData(shown)
    if len(body.faces):
        count = np.full((len(body.faces), 1), 3)
        solid = pyvista.PolyData(shown, np.hstack([count, body.faces]).ravel())
    plotter.add_mesh(solid, color="gold", opacity=0.6, point_size=6)
    unit, scale = ("mm", 1e3) if body.part == "translation" else ("mrad", 1e3)
    caption = (
        f"gold: possible {body.part} errors ({assumption}), "
        f"up to {largest * scale:.3g} {unit}"
    )
    plotter.add_text(caption, position="lower_left", font_size=9, name="body")


def displaced_bodies(assembly: Assembly, closing: float = 1.0) -> DisplacedBodies:
    """Compute the displacements of all bodies in the linear model.

    Args:
        assembly: assembly of a robot of n frames.
        closing: fraction of the deformations and joint motions. For 0, the loops are
            open due to geometric errors.

    Returns:
        The bodies in the order of the frames.
    """
    posture = assembly.posture
    turned = screw_map(np.zeros(3), posture.transforms[:, :3, :3])
    links = closing * assembly.link_screws
    joints = closing * (assembly.clearance_screws + assembly.joint_screws)
    body = turned @ (posture.robot.errors + links)[..., None]
    joint = turned @ joints[..., None]
    ends = posture.transforms[:, :3, 3]
    starts, (at_start, at_end) = body_starts(posture), np.zeros((2, len(ends), 6))
    for i, parent in enumerate(posture.robot.parents):
        if parent >= 0:
            at_start[i] = at_end[parent] + joint[parent, :, 0]
        carried = screw_map(starts[i] - ends[i]) @ at_start[i]
        at_end[i] = carried + body[i, :, 0]
    bends = turned @ links[..., None]
    return DisplacedBodies(starts, ends, at_start, at_end, bends[:, :3, 0])


def finitely_displaced_bodies(assembly: ExactAssembly) -> DisplacedBodies:
    """Compute the displacements of all bodies in the exact solution.

    Args:
        assembly: exact solution for a robot of n frames.

    Returns:
        The bodies. Rotations are rotation vectors.
    """
    posture = assembly.posture
    nominal = posture.transforms
    ends = assembly.placement.body_ends[assembly.cut.last]
    # the last row is for the base
    at_start, at_end = np.zeros((len(nominal) + 1, 6)), np.zeros((len(nominal), 6))
    for screws, T in ((at_start[:-1], assembly.transforms), (at_end, ends)):
        turned = T[:, :3, :3] @ np.swapaxes(nominal[:, :3, :3], 1, 2)
        screws[:, :3] = rotation_vector(turned)
        screws[:, 3:] = T[:, :3, 3] - nominal[:, :3, 3]
    bends = nominal[:, :3, :3] @ assembly.link_screws[:, :3, None]
    return DisplacedBodies(
        body_starts(posture), nominal[:, :3, 3], at_start[posture.robot.parents],
        at_end, bends[..., 0],
    )  # fmt: skip


def body_starts(posture: Posture) -> NDArray:
    """Return the nominal starts of all bodies, (n, 3) [m]."""
    origins = np.vstack([posture.transforms[:, :3, 3], np.zeros(3)])  # row -1: base
    return origins[posture.robot.parents]


def readable_factor(bodies: DisplacedBodies, size: float) -> float:
    """Return a factor on displacements that makes a plot readable.

    Args:
        bodies: bodies with their displacements.
        size: [m] size of the robot.

    Returns:
        The largest factor of the form 1, 2 or 5 times a power of ten for which no
        translation exceeds 10 % of the size and no rotation exceeds 0.5 rad.
    """
    shift = float(np.abs(bodies.end_screws[:, 3:]).max())
    turn = float(np.abs(bodies.end_screws[:, :3]).max())
    if shift == turn == 0.0:
        return 1.0
    most = min(0.1 * size / max(shift, 1e-300), 0.5 / max(turn, 1e-300))
    power = 10.0 ** np.floor(np.log10(most))
    return float(power * max(d for d in (1, 2, 5) if d * power <= most * (1 + 1e-12)))


def _shape(bodies: DisplacedBodies, i: int, factor: float) -> NDArray:
    """Return points along a displaced body with cubic deflection, (20, 3)."""
    a = bodies.starts[i] + factor * bodies.start_screws[i, 3:]
    b = bodies.ends[i] + factor * bodies.end_screws[i, 3:]
    if not np.any(bodies.bends[i]):
        return np.linspace(a, b, 20)
    bend = rotation_matrix(factor * bodies.bends[i])
    chord = b - a
    # The slope at each end is the mean of the chord and the rotated chord.
    slope_a, slope_b = bend.T @ chord, bend @ chord
    slope_a, slope_b = (chord + slope_a) / 2, (chord + slope_b) / 2
    s = np.linspace(0, 1, 20)[:, None]
    return (
        (2 * s**3 - 3 * s**2 + 1) * a + (s**3 - 2 * s**2 + s) * slope_a
        + (3 * s**2 - 2 * s**3) * b + (s**3 - s**2) * slope_b
    )  # fmt: skip
