"""Interactive 3D scene of a robot for an HTML page."""

from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exact.exact import ExactAssembly
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import Assembly
from forcefit.assembly.model.contact_closures import contact_frames, loops
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.report.error_body import ErrorBody
from forcefit.assembly.report.plot import (
    DisplacedBodies,
    body_starts,
    displaced_bodies,
    finitely_displaced_bodies,
    readable_factor,
)
from forcefit.page.charts import scene
from forcefit.results.units import shown_in
from forcefit.stiffness.screws import skew

# number of points along a body
_SAMPLES = 9


def robot_scene(
    assembly: Assembly, closing: NDArray | None, body: ErrorBody | None, caption: str
) -> str:
    """Return an HTML scene of the nominal and the assembled robot.

    Links with deformations are drawn as cubic curves.

    Args:
        assembly: assembly of a robot of n frames.
        closing: (k, n, 4, 4) poses of all frames during closing, or None.
        body: set of possible platform errors, or None.
        caption: text below the figure.

    Returns:
        HTML of the scene.
    """
    return scene(forced_scene(assembly, closing, body), caption)


def forced_scene(
    assembly: Assembly, closing: NDArray | None = None, body: ErrorBody | None = None
) -> dict[str, Any]:
    """Return the data of an assembled robot, see :func:`robot_scene`."""
    posture = assembly.posture
    ends = posture.transforms[:, :3, 3]
    moved = [] if closing is None else closing[:, :, :3, 3] - ends
    shape = None if body is None else _error_body(body, posture.platform[:3, 3])
    forces = _forces(assembly, posture.transforms)
    return _spec(posture, displaced_bodies(assembly), moved, forces, shape)


def exact_scene(assembly: ExactAssembly) -> dict[str, Any]:
    """Return the data of an exact solution.

    Small displacements are magnified. Large displacements are to scale.
    """
    bodies = finitely_displaced_bodies(assembly)
    forces = _forces(assembly, assembly.transforms)
    spec = _spec(assembly.posture, bodies, [], forces, None)
    factor = spec["exaggeration"] = max(1.0, spec["exaggeration"])
    box, displaced = spec["box"], bodies.ends + factor * bodies.end_screws[:, 3:]
    box[:, 0] = np.minimum(box[:, 0], displaced.min(axis=0))
    box[:, 1] = np.maximum(box[:, 1], displaced.max(axis=0))
    return spec


def nominal_scene(posture: Posture) -> dict[str, Any]:
    """Return the data of a nominal robot."""
    still = np.zeros((len(posture.robot.frames), 6))
    bodies = DisplacedBodies(
        body_starts(posture), posture.transforms[:, :3, 3], still, still, still[:, :3]
    )
    return _spec(posture, bodies, [], [], None) | {"nominal": True}


def _spec(
    posture: Posture, bodies: DisplacedBodies, closing: Any, forces: Any, body: Any
) -> dict[str, Any]:
    """Return the data of a scene."""
    ends = bodies.ends
    size = float(np.ptp(np.vstack([ends, np.zeros(3)]), axis=0).max()) or 1.0
    drawn = np.vstack([bodies.starts, ends])
    middle = (drawn.max(axis=0) + drawn.min(axis=0)) / 2
    half = np.maximum(np.ptp(drawn, axis=0) / 2, 0.15 * size) + 0.15 * size
    largest = float(np.linalg.norm(bodies.end_screws[:, 3:], axis=1).max())
    return {
        "bodies": [_body(posture.robot, bodies, i) for i in range(len(ends))],
        "closures": [
            [posture.robot.index(name) for name in pair]
            for pair in loops(posture.robot)
        ],
        "closing": closing,
        "forces": forces,
        "body": body,
        "exaggeration": readable_factor(bodies, size),
        "box": np.stack([middle - half, middle + half], axis=1),
        "length": asdict(shown_in("m", size)),
        "displacement": asdict(shown_in("m", largest)),
    }


def _body(robot: Robot, bodies: DisplacedBodies, i: int) -> dict[str, Any]:
    """Return the data of a body."""
    frame, parent = robot.frames[i], int(robot.parents[i])
    start, end = bodies.starts[i], bodies.ends[i]
    s = np.linspace(0.0, 1.0, _SAMPLES)[:, None]
    of_contact = frame.name in contact_frames(robot)
    return {
        "name": frame.name, "parent": parent, "joint": frame.joint,
        "actuated": frame.actuated, "elastic": frame.link is not None,
        "kind": "elastic" if frame.link is not None else "rigid",
        "long": bool(np.linalg.norm(end - start) > 1e-9) and not of_contact,
        "nominal": start + s * (end - start), "moved": _moved(bodies, i, s),
    }  # fmt: skip


def _moved(bodies: DisplacedBodies, i: int, s: NDArray) -> NDArray:
    """Return the displacements of points along a body, (k, 3) [m]."""
    chord = bodies.ends[i] - bodies.starts[i]
    a, b = bodies.start_screws[i, 3:], bodies.end_screws[i, 3:]
    if not np.any(bodies.bends[i]):
        return a + s * (b - a)
    # cubic curve, which is exact for a cantilever with a load at its end
    turn = bodies.start_screws[i, :3]
    slope_a, slope_b = skew(turn) @ chord, skew(turn + bodies.bends[i]) @ chord
    return (
        (2 * s**3 - 3 * s**2 + 1) * a + (s**3 - 2 * s**2 + s) * slope_a
        + (3 * s**2 - 2 * s**3) * b + (s**3 - s**2) * slope_b
    )  # fmt: skip


def _forces(
    assembly: Assembly | ExactAssembly, transforms: NDArray
) -> list[dict[str, Any]]:
    """Return the forces that links transmit at their tips, in base axes [N]."""
    posture = assembly.posture
    turned = transforms[:, :3, :3] @ assembly.tip_wrenches[:, 3:, None]
    largest = float(np.abs(turned).max(initial=0.0))
    return [
        {"body": i, "force": force}
        for i, (frame, force) in enumerate(
            zip(posture.robot.frames, turned[..., 0], strict=True)
        )
        if frame.link is not None and np.linalg.norm(force) > 1e-6 * largest
    ]


def _error_body(body: ErrorBody, origin: NDArray) -> dict[str, Any]:
    """Return the data of a set of possible platform errors."""
    sizes = np.linalg.norm(body.points, axis=1)
    shown = shown_in("m", float(sizes.max(initial=0.0)))
    text = f"possible platform errors, up to {sizes.max() * shown.factor:.4g}"
    return {
        "points": body.points, "faces": body.faces, "origin": origin,
        "text": f"{text} {shown.shown}",
    }  # fmt: skip
