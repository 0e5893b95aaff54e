"""Results of random draws for two springs in series and for IRSBot-2."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import BadInput, Clearance, solve_assembly
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.model.link_stress import peak_stresses
from forcefit.assembly.robots import load_robot
from forcefit.assembly.statistics.experiment import Experiment
from tests.robots_for_tests import coaxial_beams
from tests.tolerances_for_tests import PLAY, rigid_pair

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
    np.testing.assert_allclose(rows["margin"], d / PLAY, rtol=1e-6)
    np.testing.assert_allclose(rows["margin_free"], d / PLAY, rtol=1e-6)
    energy = STIFFNESS * pressed**2 / 4
    np.testing.assert_allclose(rows["energy"], energy, rtol=1e-6, atol=1e-10)
    force = STIFFNESS * pressed / 2
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
    widths = np.zeros(6)
    widths[axis] = 1e-3
    robot = experiment.posture.robot
    sources = tolerance_sources(robot, widths, ("one", "two"))
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
