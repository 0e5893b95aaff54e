"""Questions about what searches work out on the way, for ``answers_for_tests.py``:
steps of the exact equilibrium, scores of sets of effects, what small unknowns leave of
the readings, candidates to be learned, doubts about a campaign."""

from collections.abc import Callable
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from assembly.effects.units import units_of
from assembly.exact.dead_load import dead_loads
from assembly.exact.descent import advance, expand, potential
from assembly.exact.equilibrium import (
    active_clearances,
    curvature_modes,
    imbalance,
    least_curvature,
    tangent_space,
)
from assembly.exact.finite_robot import FiniteRobot
from assembly.exact.placement import place
from assembly.kinematics.posture import home_posture
from assembly.linear.closure import virtual_joints
from assembly.model.function import Function
from assembly.robots import load_robot
from assembly.solvers.cones import into_cones
from tests.robots_for_tests import random_robot

CAMPAIGNS = Path(__file__).parent / "campaigns"
FAINT, PLAIN, ABSURD = 1e-3, 0.7, 60.0  # of an unknown's plausible size
# parameters of one form each, their units unlike one another
NUMBERS: dict[str, tuple[str, ...]] = {
    "powers": ("0", "1", "3"), "waves": ("2.sine", "2.cosine", "period"),
    "spline": ("first", "last", "1", "2"), "reversal": ("0", "1"),
    "step": ("at", "size"), "slow_wave": ("period", "sine", "cosine"),
    "lag": ("gain", "start", "time_constant"),
    "creep": ("gain", "start", "time_constant"),
}  # fmt: skip


def digest(value: Any) -> str:
    """Words too long to be stored, as a word that changes with them."""
    return "digest " + sha256(str(value).encode()).hexdigest()


def steps(seed: int, nudge: float) -> Any:
    """A random robot's exact problem, expanded on the way, and steps from there."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, 2 + seed % 2, 3)
    posture = home_posture(robot.with_errors(1e-2 * robot.errors * (1 + nudge)))
    model = FiniteRobot(posture, virtual_joints(posture.robot))
    load, gravity = np.array([0.2, -0.1, 0.3, 4.0, -3.0, 5.0]), (0.5, 0.0, -9.81)
    loads = dead_loads(posture, load, gravity=gravity, point=(0.02, 0.0, -0.01))
    x = 1e-2 * rng.uniform(-1, 1, len(model.units)) * model.units
    x[model.bounded] = into_cones(
        rng.uniform(-1.5, 1.5, len(x[model.bounded])), model.joints.group
    )
    found, damping = [], 0.0
    at, rigid = place(model, x), None
    for near in (False, False, True, True):
        local = expand(
            at, loads, np.zeros(len(at.residual)) if rigid is None else rigid
        )
        D, H = tangent_space(local)
        held = tangent_space(local, hold_touching=True)[1]
        step = advance(local, 2 * np.linalg.norm(local.multipliers) + 1, damping, near)
        found.append({
            "residuum": at.residual, "potential": potential(at, loads),
            "gradient": local.gradient, "hessian": local.hessian,
            "multipliers": local.multipliers, "small": local.small_energy,
            "imbalance": imbalance(local), "least": least_curvature(local),
            "curvatures": curvature_modes(D, H, model.units)[0], "kept": held.shape,
            "active": active_clearances(local), "gain": step.gain,
            "decrement": step.decrement, "length": step.length,
            "damping": step.damping, "x": step.placement.x,
        })  # fmt: skip
        at, rigid, damping = step.placement, step.rigid, step.damping
    return found


def function_units(nudge: float) -> Any:
    """Units of the parameters of every form at places and variables of every kind."""
    del nudge  # no number goes in
    robot = load_robot("five_bar")
    first = next(f.name for f in robot.frames if f.actuated)
    variables = (
        f"q.{first}", "load.mx", "load.fy", f"wrench.{first}.mz", f"wrench.{first}.fx",
        "position.x", "cov.temperature", "time", "approach", "cov.humidity",
    )  # fmt: skip
    places = (
        ("reading", ("tx", "ry"), "screw"), ("load", ("fx", "my"), "screw"),
        (first, ("rz", "ty"), "screw"), (first, ("rz", "ty"), "compliance"),
    )  # fmt: skip
    found = {}
    for form, names in NUMBERS.items():
        for k, variable in enumerate(variables):
            said = []
            for where, components, kind in places:
                one = Function(
                    where, components, (variable,), form,
                    dict.fromkeys((f"{c}.{n}" for c in components for n in names), 1.0),
                    kind,
                )  # fmt: skip
                said.append(" ".join(units_of(robot, one).values()))
            found[f"{form}{k}"] = ", ".join(said)
    return found


INNER: dict[str, Callable[[float], Any]] = {
    **{f"steps {seed}": partial(steps, seed) for seed in range(3)},
    "units of forms": function_units,
}  # fmt: skip
