"""Tests of assembly steps against a sequence of simulations with finite motions."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.kinematics.se3 import logarithm
from forcefit.assembly.model.robot import BeamLink, Frame, Robot
from forcefit.assembly.steps.plan import Join, Plan, Preload, Release
from forcefit.assembly.steps.run import assemble_in_steps
from forcefit.stiffness.screws import SCREW
from forcefit.validation.multibody.simulation import simulate_assembly

pytestmark = pytest.mark.exudyn
BEAM = BeamLink({"radius": 0.01}, 2.1e11, 0.3)
FEET = {"b": [0.3, 0.0, -0.4], "c": [0.1, 0.3, -0.4]}


def three_beams(errors, closed=(), shim=None):
    """Return a platform on three beams clamped to the base, with the given closures."""
    frames = [Frame("platform", "base", translation=[0, 0, 0.5], link=BEAM)]
    pairs = {}
    for name, foot in FEET.items():
        seat, place = f"seat_{name}", np.array(foot) + [0, 0, 0.4]
        frames += [
            Frame(seat, "platform", translation=place),
            Frame(f"foot_{name}", "base", translation=place),
            Frame(
                f"end_{name}", f"foot_{name}", translation=[0, 0, 0.5], link=BEAM,
                geometric_error=errors[name],
            ),
            Frame(
                f"shim_{name}", f"end_{name}",
                geometric_error=np.zeros(6) if shim is None or name != "c" else shim,
            ),
        ]  # fmt: skip
        pairs[name] = (seat, f"shim_{name}")
    closures = tuple(pairs[name] for name in closed)
    return home_posture(Robot("three beams", "platform", tuple(frames), closures))


def by_simulation(errors, load):
    """Simulate bolting C under the load, forcing B, and removing the load."""
    open_ = three_beams(errors)
    loaded = simulate_assembly(open_, load=load)
    rows = {frame.name: i for i, frame in enumerate(open_.robot.frames)}
    seat, end = (loaded.transforms[rows[name]] for name in ("seat_c", "shim_c"))
    shim = logarithm(np.linalg.inv(end) @ seat)
    return simulate_assembly(three_beams(errors, ("c", "b"), shim))


def test_error_of_linear_assembly_steps_is_of_second_order():
    """If errors and loads are halved, the difference decreases by a factor of four."""
    errors = {
        "b": np.array([2e-3, -1e-3, 1e-3, 4e-4, -3e-4, 5e-4]),
        "c": np.array([-1e-3, 2e-3, 1e-3, -2e-4, 4e-4, 3e-4]),
    }
    load = np.array([0, 0, 0, 30.0, -20.0, 0])
    plan = Plan((
        Preload("press", "platform", load),
        Join("bolt c", ("seat_c", "shim_c"), locked=SCREW),
        Join("force b", ("seat_b", "shim_b")), Release("free", ("press",)),
    ))  # fmt: skip
    linear = assemble_in_steps(plan, three_beams(errors, ("b", "c")))[-1]
    sizes = []
    for s in (1.0, 0.5, 0.25):
        scaled = {name: s * error for name, error in errors.items()}
        found = by_simulation(scaled, s * load)
        away = found.platform_screw - s * linear.platform_screw[0]
        sizes.append(np.linalg.norm(away * [0.3, 0.3, 0.3, 1, 1, 1]))
        assert found.energy == pytest.approx(s**2 * linear.energy[0], rel=0.1 * s)
    slopes = np.log2(np.array(sizes[:-1]) / sizes[1:])
    assert slopes == pytest.approx([2.0, 2.0], abs=0.1)
    assert sizes[0] < 0.05 * np.linalg.norm(linear.platform_screw)
