"""Tests of each library effect against simulated machines with this effect.

The machines are simulated in Exudyn and by ``springs.py``.  Neither uses the effects of
the library.  For example, an elastic drive is a spring after its joint.
"""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.effects import LIBRARY, apply_effects
from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.model.robot import BeamLink
from forcefit.assembly.robots import load_robot
from forcefit.validation.multibody.simulation import without_clearance
from forcefit.validation.synthetic.effects import Row
from forcefit.validation.synthetic.machine import Hidden, simulate_readings
from tests.robots_for_tests import with_frames

POINT = np.array([0.02, 0.0, 0.05])
UNDER = {"temperature": 6.0, "time": 100.0, "approach": -1.0}
SPRING = np.diag([np.inf, np.inf, 2e4, np.inf, np.inf, np.inf])
EFFECTS = {
    "self_weight": {"g.x": 1.0, "g.z": -9.81},
    "thermal_expansion": {"leg1.elbow": 2e-5},
    # both rows have the same time, so the body is as warm as the sensor
    "delayed_expansion": {"leg1.elbow": 2e-5, "leg1.elbow.time_constant": 60.0},
    "drive_compliance": {"leg1.drive": 3e4, "leg2.drive": 5e4},
    "base_compliance": {"stiffness.rx": 1e6, "stiffness.tz": 1e7},
    "encoder_offset": {"leg3.drive": 1e-4},
    "encoder_eccentricity": {"leg1.drive.amplitude": 2e-4, "leg1.drive.phase": 0.7},
    "link_length": {"leg2.elbow": 4e-5},
    "registration": {"base.rz": 1e-4, "base.tx": 2e-4, "tool.ty": -1e-4},
    "device_scale": {"factor": 1.0005},
    "body_mass": {"leg2.elbow.mass": 0.5, "leg2.elbow.moment.x": 0.02},
    "modulus_scale": {"leg2.elbow": 0.8, "leg1.elbow": 1.3},
    "friction_hysteresis": {"leg1.drive": 0.5},
    "contact_stiffening": {"leg2.drive.coefficient": 1e6, "leg2.drive.exponent": 1.5},
    "load_gain": {"factor": 1.2, "offset.fx": 3.0},
    "drift": {"amplitude.tz": 1e-5, "time_constant": 60.0},
}
# effects that other files of this folder test
ELSEWHERE = {"geometric_stiffening", "joint_clearance"}


@pytest.fixture(scope="module")
def robot():
    """Return a 3-RRR robot with elastic links, elastic drives and errors."""
    robot = without_clearance(load_robot("3rrr"))
    beam = BeamLink({"radius": 0.012, "inner_radius": 0.008}, 70e9, 0.33, 2700.0)
    links = {
        f.name: beam
        for f in robot.frames
        if f.name.endswith(("elbow", "wrist")) and np.linalg.norm(f.translation) > 0
    }
    robot = robot.with_links(links)
    robot = with_frames(robot, lambda f: f.actuated, joint_stiffness=SPRING)
    rng = np.random.default_rng(3)
    errors = 3e-5 * rng.standard_normal(robot.errors.shape)
    return robot.with_errors(errors)


@pytest.fixture(scope="module")
def machine(robot):
    """Return conditions and rows for two postures under different loads."""
    drives = [f.name for f in robot.frames if f.actuated]
    placed = [
        place_robot(robot, joints={n: robot.frame(n).position + d for n in drives})
        for d in (0.0, 0.05)
    ]
    loads = np.array([[1, -2, 1, 15, -8, 20], [0, 1, -2, -10, 12, 5.0]])
    both = replace(
        placed[0],
        coordinates=np.stack([p.coordinates for p in placed]),
        transforms=np.stack([p.transforms for p in placed]),
    )
    rows = [
        Row(dict(zip((f.name for f in robot.frames), p.coordinates, strict=True)), w,
            UNDER)
        for p, w in zip(placed, loads, strict=True)
    ]  # fmt: skip
    return as_declared(both, loads, point=POINT, covariates=UNDER), rows


def test_every_effect_of_the_library_is_tested():
    assert EFFECTS.keys() | ELSEWHERE == LIBRARY.keys()


@pytest.mark.exudyn
@pytest.mark.parametrize("program", ["springs", "multibody"])
@pytest.mark.parametrize(
    "name",  # two of three are slow tests
    [pytest.param(n, marks=[pytest.mark.slow] * (i % 3 > 0))
     for i, n in enumerate(EFFECTS)],
)  # fmt: skip
def test_library_effect_agrees_with_the_simulated_effect(name, program, robot, machine):
    """Second-order motions and the bending of beams limit the agreement to 3e-8.

    Effects that lengthen a beam are tested without load, because the simulated longer
    beam is softer.
    """
    conditions, rows = machine
    conditions = replace(conditions, exact=True)
    if name in {"link_length", "thermal_expansion", "delayed_expansion"}:
        conditions = replace(conditions, load=0 * conditions.load)
        rows = [replace(row, load=np.zeros(6)) for row in rows]
    if name == "body_mass":
        conditions = replace(conditions, gravity=np.array([[0, 0, -9.81]] * 2))
        weight = {"gravity.z": -9.81}
        rows = [replace(r, covariates={**r.covariates, **weight}) for r in rows]
    there = apply_effects(conditions, {name: EFFECTS[name]})
    added = predict(there).deviation - predict(conditions).deviation
    with_it, without = (
        simulate_readings(robot, POINT, rows, hidden, program)
        for hidden in ([Hidden(name, EFFECTS[name])], [])
    )
    assert np.abs(with_it - without).max() > 1e-6
    np.testing.assert_allclose(added, with_it - without, rtol=0, atol=3e-8)
