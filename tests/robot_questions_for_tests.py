"""Results for random and built-in robots, for ``answers_for_tests.py``."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.nominal import motion_screws, size_of
from forcefit.assembly.kinematics.pieces import cut_beams
from forcefit.assembly.kinematics.posture import (
    place_many,
    place_many_joints,
    place_robot,
)
from forcefit.assembly.kinematics.singularity import find_singularities
from forcefit.assembly.linear.certificate import bound_screw
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.reference.pose_error import ASSUMPTIONS
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.model.robot import Clearance, Frame, MatrixLink, Robot
from forcefit.assembly.robots import load_robot
from forcefit.assembly.statistics.allocated_tolerances import (
    allocation_of,
    allocation_text,
)
from forcefit.assembly.statistics.allocation import allocate
from forcefit.assembly.statistics.clearance_positions import CLEARANCE_MODELS
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.linear_response import LinearResponse, linear_response
from forcefit.assembly.statistics.monte_carlo import run_draws
from forcefit.assembly.statistics.posture_margins import PostureMargins, prepare_margins
from forcefit.assembly.statistics.scenes import drawn_robot, margin_map, tightest_robot
from forcefit.assembly.statistics.summary import summarise, summary_text
from forcefit.assembly.statistics.tolerances import present_errors, present_text
from tests.built_in_robots_for_tests import CLOSE, LOAD, WORKSPACE
from tests.robots_for_tests import random_robot, small_clearance
from tests.tolerances_for_tests import plan_for


def of_any_kind(seed: int, nudge: float) -> Any:
    """Compute energy, margins and pose errors of a random robot."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, legs=2 + seed % 2, branched=seed % 3 == 0)
    posture = place_robot(robot.with_errors(0.1 * robot.errors * (1 + nudge)))
    found: dict[str, Any] = {}
    for name, load in (("alone", None), ("loaded", np.array(LOAD) / 10)):
        solved = solve_assembly(posture, load)
        found[name] = {
            "solved": solved,
            "bound": bound_screw(solved),
            "energy_lower_bound": solved.energy - solved.duality_gap(),
        }
    for reading in ASSUMPTIONS:
        some = bound_pose_error(
            found["alone"]["solved"], reading, energy_budget=0.1, **CLOSE
        )
        found[reading] = {
            "sizes": [[*some.rotation_error], [*some.translation_error]],
        }
    for reading in ("rigid", "free"):
        zone = zone_margin(posture, reading)
        found[reading] = {
            "margin": zone.margin, "bound": zone.bound, "method": zone.method
        }  # fmt: skip
    return found


def at_once(name: str, nudge: float) -> Any:
    """Compute energies and margins for several error draws in one call."""
    robot = pressed(load_robot(name))
    where = {key: (2 * low + high) / 3 for key, (low, high) in WORKSPACE[name].items()}
    posture = place_robot(robot, where)
    size = [2e-4] * 3 + [5e-5] * 3
    errors = np.random.default_rng(5).uniform(-1, 1, (4, len(robot.frames), 6)) * size
    errors = errors * (1 + nudge)
    load, gravity = np.array(LOAD) / 5, (0.5, 0.0, -9.81)
    return {
        "alone": drawn(linear_response(posture), errors),
        "loaded": drawn(linear_response(posture, load, gravity), errors),
        **{r: margins(prepare_margins(posture, r), errors) for r in ("free", "rigid")},
    }


def drawn(response: LinearResponse, errors: NDArray) -> dict[str, Any]:
    """Return the quantities of the draws that statistics use."""
    found = response.solve(errors)
    names = ("energy", "clearances", "multipliers", "platform_screw", "method")
    own = {name: getattr(found, name) for name in names}
    return own | {"bound": found.energy - found.duality_gap()}


def margins(prepared: PostureMargins, errors: NDArray) -> dict[str, Any]:
    """Return the margins of the draws and their derivatives."""
    found = prepared.solve(errors)
    own = {name: getattr(found, name) for name in ("margin", "bound", "method")}
    return own | {"slopes": prepared.slopes(found)}


def pressed(robot: Robot) -> Robot:
    """Return the robot with an additional clearance in every third joint."""
    frames = [
        replace(f, clearance=small_clearance(2e-5 * (1 + i)))
        if i % 3 == 1 and f.clearance is None and f.joint != "fixed"
        else f
        for i, f in enumerate(robot.frames)
    ]
    return replace(robot, frames=tuple(frames))


def placed(name: str, nudge: float) -> Any:
    """Compute postures, free motions, singularities and subdivided beams."""
    robot = load_robot(name)
    keys = ("tx", "ty", "tz", "rx", "ry", "rz")
    shares = np.random.default_rng(2).uniform(0.2, 0.8, (3, 6)) * (1 + nudge)
    box = [WORKSPACE[name].get(key, (np.nan, np.nan)) for key in keys]
    poses = np.array([[a + s * (b - a) for s, (a, b) in zip(share, box, strict=True)]
                      for share in shares])  # fmt: skip
    postures, track = place_many(robot, poses)
    drives = np.array([f.actuated for f in robot.frames])
    at = np.array([posture.transforms for posture in postures])
    coordinates = np.array([posture.coordinates for posture in postures])
    again = place_many_joints(robot, np.where(drives, coordinates * 1.001, np.nan))
    return {
        "poses": postures, "track": track, "joints": again, "size": size_of(robot),
        "motions": [motion_screws(robot, T) for T in at],
        "singular": find_singularities(robot, at),
        "pieces": cut_beams(robot).robot,
    }  # fmt: skip


def in_a_row(play: float) -> Robot:
    """Return two elastic bars that are connected by a joint with clearance."""
    link = MatrixLink(np.diag([2e3, 2e3, 2e3, 1e6, 2e6, 1e6]))
    frames = (
        Frame("one", translation=[0.5, 0, 0], link=link),
        Frame("mount", translation=[1.0, 0, 0]),
        Frame("two", "mount", [-0.5, 0, 0], link=link),
        Frame("joint", "one", clearance=Clearance(radial=play, tilt=1e-4)),
        Frame("end_one", "joint"),
        Frame("end_two", "two"),
    )
    return Robot("bars", "end_one", frames, (("end_one", "end_two"),))


def by_play(model: str, nudge: float) -> Any:
    """Allocate tolerances with a given clearance model."""
    robot = in_a_row(1e-4 * (1 + nudge))
    plan = plan_for(
        robot, [("one", 3), ("two", 4), ("two", 1)], [1, 2, 0.5],
        {"translation": 2.5e-4, "force": 400.0, "moment": 1.0},
        asked_yield=0.9, draws=30, clearance=model,
    )  # fmt: skip
    told: list[tuple[str, int, int]] = []
    found = allocate([place_robot(robot)], plan, 20, lambda *words: told.append(words))
    results = allocation_of(found)
    return {"found": found, "told": told, "text": allocation_text(results)}


def shown(nudge: float) -> Any:
    """Return the texts, scenes and progress messages for declared and random errors."""
    robot = in_a_row(1e-4)
    errors = np.zeros((6, 6))
    errors[[0, 2], :] = [[1e-4, 0, 5e-5, 4e-5, 3e-5, 0], [0, 2e-4, 0, 1e-5, 0, 2e-5]]
    postures = [place_robot(robot.with_errors(errors * (1 + nudge)))]
    told: list[tuple[int, int]] = []
    present = present_errors(postures, "rigid", lambda *words: told.append(words))
    sources = tolerance_sources(robot, [1e-4 * (1 + nudge)] * 6, ("one", "two"))
    experiment = Experiment(postures[0], sources, 4, "contact")
    data = run_draws(experiment, 9, progress=lambda *words: told.append(words))
    summary = summarise(data, {"energy": 1e-3, "margin": 1.0}, None, 0.8)
    return {
        "present": present, "told": told, "summary": summary,
        "texts": present_text(present) + summary_text(
            {"robot": "bars", "pose": postures[0].pose(), "seed": 4} | summary
        ),
        "scenes": drawn_robot(experiment, data) + tightest_robot(postures, present)
        + margin_map(postures, present),
    }  # fmt: skip


ROBOTS: dict[str, Callable[[float], Any]] = {
    **{f"of any kind, {seed}": partial(of_any_kind, seed) for seed in range(4)},
    **{f"at once, {n}": partial(at_once, n) for n in ("hexapod", "3rrr", "five_bar")},
    **{f"placed, {n}": partial(placed, n) for n in WORKSPACE},
    **{f"tolerances, {m}": partial(by_play, m) for m in CLEARANCE_MODELS},
    "shown": shown,
}
