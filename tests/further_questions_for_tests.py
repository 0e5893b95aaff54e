"""Results of less common functions, for ``answers_for_tests.py``.

They include refined meshes, repaired surfaces, finite motions and undetermined poses.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from forcefit.assembly.effects.places import drives
from forcefit.assembly.kinematics.posture import Posture, place_many_joints, place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.nearest_pose import nearest_pose
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.reference.pose_error import reachable_screws
from forcefit.assembly.measurement.conditions import ContactLaw, as_declared
from forcefit.assembly.measurement.predict import predict, with_finite_motions
from forcefit.assembly.measurement.settled_clearance import without_joint_clearances
from forcefit.assembly.report.error_body import error_body
from forcefit.assembly.robots import load_robot
from forcefit.assembly.statistics.stiffness_spread import draw_stiffnesses
from forcefit.stiffness.fem.fea import FemOptions, solve_bar
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.surface.decimate import coarser_surface
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.patches import triangles_on
from forcefit.stiffness.surface.surface import check_surface
from tests.built_in_robots_for_tests import LOAD, WORKSPACE
from tests.solids_for_tests import cylinder


def refined(nudge: float) -> Any:
    """Solve a bar by finite elements with mesh refinement, to two accuracies."""
    section = {"width": 0.3 * (1 + nudge), "height": 0.3}
    material = Material(7e10, 0.31, density=2700.0)
    return [
        solve_bar(section, material, FemOptions(accuracy, interface=kind)).link
        for accuracy, kind in ((0.02, "rigid"), (0.003, "distributing-both"))
    ]


def repaired(nudge: float) -> Any:
    """Check surfaces with reversed triangles, a cavity or unmerged corners."""
    points, triangles = cylinder(0.02, 0.1 * (1 + nudge), 24)
    rng = np.random.default_rng(4)
    found = []
    for share in (0.0, 0.2, 0.7, 1.0):
        turned = rng.random(len(triangles)) < share
        some = np.where(turned[:, None], triangles[:, ::-1], triangles)
        found.append(check_surface(points, some, "turned"))
    inner = 0.5 * points + [0, 0, 0.025]
    both = np.concatenate([triangles, triangles + len(points)])
    found.append(check_surface(np.concatenate([points, inner]), both, "hollow"))
    soup = points[triangles].reshape(-1, 3)
    soup = soup + 1e-9 * rng.normal(size=soup.shape)
    apart = np.arange(len(soup)).reshape(-1, 3)
    found.append(check_surface(soup, apart, "soup"))
    ends = [triangles_on(found[0], parse_interface("z=0"), "base")]
    coarse = [coarser_surface(found[0], tolerance) for tolerance in (2e-4, 2e-3)]
    return {"surfaces": found, "ends": ends, "coarse": coarse}


def finite(name: str, nudge: float) -> Any:
    """Predict readings with loads, errors, contacts and subdivided beams."""
    robot = without_joint_clearances(load_robot(name))
    rng = np.random.default_rng(7)
    home = np.array([f.position if f.actuated else np.nan for f in robot.frames])
    size = {"five_bar": 0.3, "hexapod": 0.02, "arm6": 0.4}[name]
    wanted = home + size * rng.uniform(-1, 1, (3, len(home)))
    postures = [p for p in place_many_joints(robot, wanted)[0] if p is not None] * 2
    loads = rng.uniform(-1, 1, (len(postures), 6)) * np.repeat([5.0, 100.0], 3)
    rows = as_declared(
        Posture(
            robot, np.array([p.coordinates for p in postures]),
            np.array([p.transforms for p in postures]), 1e-9,
        ),
        loads * (1 + nudge), mismatch=[p.mismatch for p in postures],
        point=[0.02, -0.01, 0.03], gravity=[1.0, 2.0, -9.81],
    )  # fmt: skip
    rows = replace(rows, errors=rng.uniform(-1, 1, rows.errors.shape) * 2e-4)
    law = (ContactLaw(drives(robot)[0], 3e6, 1.5),)
    links = {
        f.name: replace(f.link, pieces=2)
        for f in robot.frames
        if f.link is not None and hasattr(f.link, "pieces")
    }
    changed = {"plain": rows, "contact": replace(rows, laws=law)}
    if links:
        changed["cut"] = replace(rows, robot=robot.with_links(links))
    return {
        key: [
            predict(one).deviation,
            predict(replace(one, exact=True)).deviation,
            with_finite_motions(one).second_order,
        ]
        for key, one in changed.items()
    }


def left_free(name: str, nudge: float) -> Any:
    """Compute nearest poses, sets of possible pose errors, and random stiffnesses."""
    where = {key: (2 * low + high) / 3 for key, (low, high) in WORKSPACE[name].items()}
    robot = load_robot(name)
    rng = np.random.default_rng(8)
    errors = rng.uniform(-1, 1, (3, len(robot.frames), 6)) * [2e-4] * 1
    posture = place_robot(robot.with_errors(errors[0] * (1 + nudge)), where)
    found: dict[str, Any] = {}
    for key, load in (("alone", None), ("loaded", np.array(LOAD) / 10)):
        solved = solve_assembly(posture, load)
        found[key] = nearest_pose(solved, (0.01, -0.02, 0.03))
        bound = bound_pose_error(solved, "free", offset=(0.0, 0.03, 0.0))
        found[f"error {key}"] = [[*bound.rotation_error], [*bound.translation_error]]
    reachable = reachable_screws(solve_assembly(posture), "frozen")
    for part in ("rotation", "translation"):
        if not reachable.unbounded(0 if part == "rotation" else 3):
            body = error_body(reachable, part, 20)
            found[part] = [body.points, body.directions, body.heights]
    for state in ("contact", "exact"):
        found[state] = draw_stiffnesses(posture, errors, state, np.array(LOAD) / 10)
    return found


FURTHER: dict[str, Callable[[float], Any]] = {
    "refined": refined,
    "repaired": repaired,
    **{f"finite {n}": partial(finite, n) for n in ("five_bar", "hexapod", "arm6")},
    **{f"left free, {n}": partial(left_free, n)
       for n in ("five_bar", "hexapod", "delta")},
}  # fmt: skip
