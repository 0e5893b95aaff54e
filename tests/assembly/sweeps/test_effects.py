"""Sweeps of robots under load and with effects."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import BadInput, load_robot, place_robot, solve_assembly, sweep
from forcefit.assembly.effects.robot_effects import apply_robot_effects
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.model.function import Function
from forcefit.assembly.sweeps.plan import Sweep
from forcefit.assembly.sweeps.quantities import Question
from forcefit.assembly.sweeps.request import SweepOptions, ask_sweep
from forcefit.assembly.sweeps.sweep import sweep_in_memory
from forcefit.assembly.sweeps.targets import grid_targets, parse_grid
from tests.assembly.files.test_effect_file import L, arm_with
from tests.robots_for_tests import NUMBERS, irsbot2_with

G = 9.81
GRID = "tx=-0.1:0.1:0.2,tz=-0.45"
EFFECTS = {
    "encoder_eccentricity": {"leg1.drive.amplitude": 2e-4, "leg1.drive.phase": 0.5},
    "drive_compliance": {"leg2.drive": 4e4},
    "base_compliance": {"stiffness.rz": 5e4, "stiffness.tx": 4e6},
    "thermal_expansion": {"leg1.link_a": 2e-5},
}


def swept(robot, grid, **given):
    axes = parse_grid(grid)
    question = Question(robot, components=tuple(axes), **given)
    return sweep_in_memory(Sweep(question, grid_targets(axes)))


def test_sweep_of_a_loaded_arm_equals_hand_calculation(tmp_path):
    """The rotation is M / k with M = F L cos q for a load and M = m g L cos q / 2 for
    the weight of the beam.
    """
    path = arm_with(tmp_path)
    data = sweep(
        path, grid="q.drive=0:1.2:0.4", assumption="none", load=[0, 0, 0, 0, 10, 0],
        gravity=[0, -G, 0], wrench_of=["drive"],
    )  # fmt: skip
    q = data["q.drive"].values
    assert q.shape == (4,)
    weight = 2700 * np.pi * 0.015**2 * L * G
    M = (10 - weight / 2) * L * np.cos(q)
    joint = solve_assembly(
        place_robot(read_robot(path), joints={"drive": 0.4}),
        [0, 0, 0, 0, 10, 0], gravity=[0, -G, 0],
    )  # fmt: skip
    # The bar deforms too, so only the rotation of the drive is known.
    assert data.platform_screw.values[1] == pytest.approx(joint.platform_screw)
    assert joint.joint_screws[0][2] == pytest.approx(M[1] / 4e4, rel=1e-9)
    assert data.wrench.values[:, 0, 2] == pytest.approx(M, rel=1e-9)
    assert data.duality_gap.values == pytest.approx(0.0, abs=1e-12)


# an error that depends on a drive coordinate, and a compliance that depends on a
# covariate
WAVE = Function("leg1.drive", ("rz",), ("q.leg1.drive",), "waves", {"2.sine": 3e-4})
SOFT = Function("leg2.drive", ("rz",), ("cov.tilt",), "powers", {"1": 1e-6},
                kind="compliance")  # fmt: skip
LOAD = [5.0, 0, 0, 100.0, -40.0, -200.0]


@pytest.mark.parametrize(
    ("declared", "under", "load"),
    [
        pytest.param({"effects": EFFECTS}, {"temperature": 8.0}, None,
                     marks=pytest.mark.slow),
        ({"effects": EFFECTS}, {"temperature": 8.0}, LOAD),
        ({"functions": (WAVE,)}, {}, None),
        ({"functions": (WAVE, SOFT)}, {"tilt": 5.0}, [0.0, 0, 0, 30.0, 0, -50.0]),
    ],
)  # fmt: skip
def test_sweep_with_effects_equals_single_solutions(declared, under, load):
    """Energies are certified to 1e-8, so screws agree to about 1e-4."""
    robot = replace(irsbot2_with(NUMBERS["cases"][0]), **declared)
    data = swept(robot, GRID, under=under, linearisation="effects" in declared,
                 wrenches=("leg1.link_a",), load=load or (0.0,) * 6)  # fmt: skip
    for tx in (-0.1, 0.1):
        there = data.sel(tx=tx, tz=-0.45, method="nearest")
        posture = place_robot(robot, pose={"tx": tx, "tz": -0.45})
        applied = apply_robot_effects(posture, load, covariates=under)
        one = solve_assembly(applied.posture, applied.load)
        assert there.status == "ok"
        assert float(there.energy) == pytest.approx(one.energy, rel=1e-6)
        row = applied.posture.robot.index("leg1.link_a")
        assert there.wrench.values[0] == pytest.approx(
            one.wrenches[row], rel=1e-3, abs=1e-3 * np.abs(one.wrenches).max()
        )
        size = np.abs(one.platform_screw).max()
        assert there.platform_screw.values == pytest.approx(
            one.platform_screw, abs=1e-3 * size
        )
        plain = solve_assembly(replace(posture, robot=robot.without_effects()), load)
        if "effects" in declared:
            assert abs(one.energy / plain.energy - 1) > 0.05
        else:  # the rods prevent a rotation
            change = (one.platform_screw - plain.platform_screw)[3:]
            assert np.abs(change).max() > 0.02 * np.abs(plain.platform_screw[3:]).max()


def test_sweep_stores_device_readings():
    """A device that is displaced by b reads b more."""
    shift = {"base.tx": 3e-5, "base.tz": -1e-5}
    robot = irsbot2_with(NUMBERS["cases"][0])
    data = swept(replace(robot, effects={"registration": shift}), GRID)
    added = (data["reading"] - data.platform_screw).values
    expected = np.zeros_like(added)
    expected[..., 3], expected[..., 5] = 3e-5, -1e-5
    assert added == pytest.approx(expected, abs=1e-15)
    assert "reading" not in swept(robot, GRID)


def test_load_without_resistance_has_the_status_no_equilibrium():
    """The robot has no actuated joints."""
    robot = load_robot("five_bar")
    frames = tuple(
        replace(f, actuated=False, joint_stiffness=None) if f.actuated else f
        for f in robot.frames
    )
    falls = replace(robot, frames=frames)
    data = swept(falls, "tx=0:0.02:0.02,ty=0.13", load=(0, 0, 0, 100, 0, 0))
    assert set(data.status.values.astype(str).ravel()) == {"no equilibrium"}
    assert "no joint or spring resists" in str(data.reason.values.ravel()[0])


def test_sweep_rejects_bounds_under_load_and_missing_covariates(tmp_path):
    with pytest.raises(BadInput, match="--assumption none"):
        ask_sweep("irsbot2", SweepOptions(grid=GRID, load=[0, 0, 0, 0, 0, 1.0]))
    warm = 'name = "thermal_expansion"\nparameters = { tool = 2e-5 }'
    path = str(arm_with(tmp_path, warm))
    with pytest.raises(BadInput, match="--under temperature=NUMBER"):
        ask_sweep(path, SweepOptions(grid="q.drive=0:1:0.5"))
    asked, other = (
        ask_sweep(path, SweepOptions(grid="q.drive=0:1:0.5", under={"temperature": t}))
        for t in (0.0, 3.0)
    )
    assert "--under temperature=0" in asked.command
    assert asked.identity != other.identity
