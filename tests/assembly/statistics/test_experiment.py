"""Results of random draws with and without loads."""

import json
from dataclasses import replace

import numpy as np
import pytest

from forcefit import (
    BadInput,
    BeamLink,
    Clearance,
    Frame,
    MatrixLink,
    Robot,
    load_robot,
    solve_assembly,
)
from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.error_distributions import (
    draw_generator,
    tolerance_sources,
)
from forcefit.assembly.model.link_stress import peak_stresses
from forcefit.assembly.statistics.clearance_positions import position_clearances
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.monte_carlo import run_draws
from tests.robots_for_tests import coaxial_beams
from tests.tolerances_for_tests import PLAY, arm, drawn_errors, rigid_pair

STIFFNESS = 1e6  # [N/m]


def springs(radial=PLAY, **options):
    """Return an experiment on two coaxial bars of 0.5 m with a joint clearance."""
    play = Clearance(radial=radial)
    robot = coaxial_beams(np.zeros(6), (STIFFNESS, STIFFNESS), clearance=play)
    sources = tolerance_sources(robot, [0, 0, 0, 4e-4, 4e-4, 0], ("one", "two"))
    return Experiment(home_posture(robot), sources, **options)


def test_energy_and_force_of_two_springs_equal_closed_forms():
    """For a gap d larger than the clearance p, the energy is k (d - p)^2 / 4.

    The force is k (d - p) / 2, the moment is this force times 0.5 m, and both margins
    are d/p.
    """
    experiment = springs()
    values = experiment.sources.draw(0, 40, seed=1)
    rows = experiment.evaluate(values, range(40))
    x, y = values[:, 0] - values[:, 2], values[:, 1] - values[:, 3]
    d = np.hypot(x, y)
    pressed = np.maximum(d - PLAY, 0.0)
    force, energy = STIFFNESS * pressed / 2, STIFFNESS * pressed**2 / 4
    np.testing.assert_allclose(rows["margin"], d / PLAY, rtol=1e-6)
    np.testing.assert_allclose(rows["margin_free"], d / PLAY, rtol=1e-6)
    np.testing.assert_allclose(rows["energy"], energy, rtol=1e-6, atol=1e-10)
    np.testing.assert_allclose(rows["force"], force, rtol=1e-5, atol=1e-3)
    across = np.divide(np.abs(y), d) * force
    np.testing.assert_allclose(rows["moment"], 0.5 * across, rtol=1e-5, atol=1e-3)
    assert (rows["status"] == 0).all()
    gap = rows["duality_gap"]
    assert (gap >= 0.0).all()
    assert (gap <= 1e-7 * rows["energy"] + 1e-12).all()


@pytest.mark.parametrize("axis", range(3))
def test_twisted_springs_transmit_a_moment_without_force(axis):
    """Two torsion springs k in series, twisted by d, transmit the moment k d / 2."""
    experiment = springs(margins=False, clearance="least")
    sources = tolerance_sources(
        experiment.posture.robot, np.eye(6)[axis] * 1e-3, ("one", "two")
    )
    rows = replace(experiment, sources=sources).evaluate(
        np.array([[1e-3, 0.0], [0.5e-3, -1.5e-3]]), range(2)
    )
    d = np.array([1e-3, 2e-3])
    np.testing.assert_allclose(rows["energy"], STIFFNESS * d**2 / 4, rtol=1e-6)
    np.testing.assert_allclose(rows["moment"], STIFFNESS * d / 2, rtol=1e-6)
    np.testing.assert_allclose(rows["force"], 0.0, atol=1e-3)


def test_draws_that_cannot_be_assembled_have_nan_results():
    """Rigid bodies without clearance can be assembled only if both errors are equal."""
    robot = rigid_pair()
    sources = tolerance_sources(robot, [0, 0, 0, 3e-4, 0, 0], ("one", "two"))
    rows = Experiment(home_posture(robot), sources, margins=False).evaluate(
        np.array([[1e-4, 1e-4], [1e-4, 2e-4]]), range(2)
    )
    assert rows["status"].tolist() == [0, 1]
    for name in ("energy", "translation", "translation_lower", "force"):
        assert np.isnan(rows[name]).tolist() == [False, True]
    assert "margin" not in rows.dtype.names


def test_stress_of_draws_equals_single_solutions(rng):
    posture = place_robot(load_robot("irsbot2"), {"tx": 0.1, "tz": -0.5})
    robot = posture.robot
    sources = tolerance_sources(robot, [0, 0, 0, 2e-3, 0, 0])
    experiment = Experiment(posture, sources, margins=False, clearance="least")
    values = rng.uniform(-2e-3, 2e-3, size=(2, len(sources)))
    rows = experiment.evaluate(values, range(2))
    assert experiment.links == tuple(
        f"leg{leg}.link_{link}" for leg in (1, 2) for link in "ab"
    )
    for errors, found in zip(sources.errors(values), rows["stress"], strict=True):
        answer = solve_assembly(replace(posture, robot=robot.with_errors(errors)))
        expected = peak_stresses(robot, answer.wrenches)
        np.testing.assert_allclose(found, expected, rtol=1e-2)
    assert replace(experiment, stress=False).links == ()
    assert replace(experiment, stress=False).solve(0, 1)["stress"].shape == (1, 0)


def test_limits_on_quantities_that_are_not_computed_are_rejected():
    posture = place_robot(load_robot("irsbot2"))
    sources = tolerance_sources(posture.robot, [1e-3] * 6)
    whole = Experiment(posture, sources)
    whole.check_limits(["margin", "margin_free", "stress", "energy"])
    bare = replace(whole, margins=False, stress=False)
    bare.check_limits(["energy", "force"])
    for limit, message in (
        ("margin", "limit margin: the margins are not computed"),
        ("margin_free", "limit margin_free: the margins are not computed"),
        ("stress", "limit stress: found no link of irsbot2 with a known shape, so no "
                   "stress is computed"),
    ):  # fmt: skip
        with pytest.raises(BadInput) as error:
            bare.check_limits(["energy", limit])
        assert str(error.value) == message


LOAD = [1.0, 2.0, 3.0, 30.0, 10.0, -100.0]


def cantilever():
    """Return a steel bar of 1 m length and 20 mm diameter, clamped at one end."""
    bar = BeamLink({"radius": 0.01}, 200e9, 0.3, theory="euler")
    frames = (Frame("tip", translation=[1.0, 0, 0], link=bar),)
    return home_posture(Robot("bar", "tip", frames))


def test_energy_and_stress_of_a_cantilever_equal_textbook_values():
    """The energy is F^2 L^3 / 6 E I, the moment is F L, and the stress is F L / W."""
    posture, F = cantilever(), 100.0
    sources = tolerance_sources(posture.robot, [1e-3] * 3 + [1e-4] * 3)
    load = (0.0, 0.0, 0.0, 0.0, 0.0, -F)
    data = run_draws(Experiment(posture, sources, margins=False, load=load), 20)
    second = np.pi * 0.01**4 / 4
    np.testing.assert_allclose(data["energy"], F**2 / (6 * 200e9 * second), rtol=1e-9)
    np.testing.assert_allclose(data["force"], F, rtol=1e-9)
    np.testing.assert_allclose(data["stress"], F * 0.01 / second, rtol=1e-2)
    sag = data["platform_screw"].values[:, 5] - sources.draw(0, 20, 1)[:, 5]
    np.testing.assert_allclose(sag, -F / (3 * 200e9 * second), rtol=1e-9)


@pytest.mark.parametrize("play", ["uniform", "contact"])
@pytest.mark.parametrize("load", [[0, 0, 0, 0, 0, -1], [0, 0, 0, 1, 0, 0]])
def test_load_does_no_work_for_motions_within_clearances(play, load):
    """Otherwise, a lower value of energy minus work would exist."""
    robot = load_robot("3rrr")
    one = linear_response(home_posture(robot), load)
    found = one.solve(drawn_errors(robot, 4.0) / 50)
    generators = [draw_generator(1, d, 1) for d in range(8)]
    settled, mixed = position_clearances(one, found, play, generators)
    assert mixed.all()
    moved = settled - found.platform_screw
    assert np.abs(moved).max() > 3e-5
    assert np.abs(moved @ load).max() < 1e-9 * np.abs(moved).max()


def test_random_errors_with_a_load_on_a_free_motion_are_rejected():
    robot = replace(arm(passive=True), name="swing")
    sources = tolerance_sources(robot, [1e-3] * 3 + [1e-4] * 3)
    swing = Experiment(home_posture(robot), sources, load=(0, 0, 0, 0, 1.0, 0))
    with pytest.raises(BadInput, match=r"^swing: .*motion"):
        run_draws(swing, 4)


def test_statistics_command_applies_load_and_gravity(tmp_path, run):
    """A force limit is satisfied for a small load and exceeded for a large load."""
    write_robot(cantilever().robot, tmp_path / "bar.toml")
    (tmp_path / "errors.toml").write_text(
        '[[errors]]\nframes = ["tip"]\nmost = [0, 0, 0, 1e-4, 1e-4, 1e-4]\n'
    )
    said = []
    for load in ("fz=-1", "fz=-100"):
        status, out, err = run(
            "assembly", "statistics", tmp_path / "bar.toml", "--errors",
            tmp_path / "errors.toml", "--draws", 50, "--load", load, "--limit",
            "force=50", "--gravity", "z=-9.81", "--json", "-",
        )  # fmt: skip
        assert status == 0, err
        said.append(json.loads(out))
    assert [one["exceeds"]["force"]["probability"] for one in said] == [0.0, 1.0]
    assert said[1]["load"] == [0, 0, 0, 0, 0, -100]
    assert said[1]["gravity"] == [0, 0, -9.81]


@pytest.mark.parametrize("load", [None, LOAD])
def test_random_errors_replace_errors_in_the_robot_file(load):
    """The results do not depend on the errors in the robot file."""
    robot = load_robot("irsbot2")
    posture, errors = place_robot(robot), drawn_errors(robot, 4.0, 2)
    own = replace(posture, robot=robot.with_errors(0.5 * errors[::-1][0]))
    plain, other = (linear_response(p, load).solve(errors) for p in (posture, own))
    np.testing.assert_allclose(other.energy, plain.energy, rtol=1e-6)
    np.testing.assert_allclose(
        other.platform_screw, plain.platform_screw, rtol=1e-4, atol=1e-8
    )


def test_load_and_error_together_move_a_joint_to_its_limit():
    """Under the moment M, a pin with motion limit L and spring K rotates by M / K minus
    the error. For M = K L and errors of -L / 2 or L / 2, it is at its limit or within
    it.
    """
    L, K = 1e-3, 2e4
    robot = Robot("pin", "end", (
        Frame("pin", joint="revolute", clearance=Clearance(spin=L)),
        Frame("end", "pin", [1.0, 0, 0]),
        Frame("stop", link=MatrixLink(K * np.eye(6))),
        Frame("at_end", "stop", [1.0, 0, 0]),
    ), (("end", "at_end"),))  # fmt: skip
    load = np.array([0, 0, K * L, 0, 0, 0])
    errors = np.zeros((2, 4, 6))
    errors[:, 0, 2] = 0.5 * L, -0.5 * L
    found = linear_response(home_posture(robot), load).solve(errors)
    assert found.method.tolist() == ["compiled", "compiled"]
    turned = np.array([L, 0.5 * L])  # of the spring, by L / 2 with the pin at its limit
    assert found.energy == pytest.approx(K * turned**2 / 2, rel=1e-6)
    assert found.platform_screw[:, 2] == pytest.approx(turned, rel=1e-6)
    # The certificate refers to the energy without the work of the load.
    assert (found.duality_gap() < 1e-8 * found.energy).all()


def test_load_moves_a_free_joint_to_its_motion_limit():
    """A link of stiffness K on a pin with motion limit L rotates by L + M / K."""
    L, K, M = 1e-3, 2e4, 20.0
    robot = Robot("pin", "end", (
        Frame("pin", joint="revolute", clearance=Clearance(spin=L)),
        Frame("end", "pin", [1.0, 0, 0], link=MatrixLink(K * np.eye(6))),
    ))  # fmt: skip
    errors = np.zeros((3, 2, 6))
    errors[:, 1, 2] = 0.0, 1e-4, -2e-4
    one = linear_response(home_posture(robot), [0, 0, M, 0, 0, 0])
    found = one.solve(errors)
    assert found.clearances == pytest.approx(1.0)
    assert found.energy == pytest.approx(M**2 / (2 * K), rel=1e-6)
    turned = L + M / K + errors[:, 1, 2]
    assert found.platform_screw[:, 2] == pytest.approx(turned, rel=1e-6)
