"""Limits at every posture: two springs in a row, whose results are known."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture, place_robot
from assembly.linear.energy import solve_assembly
from assembly.model.link_stress import peak_stresses
from assembly.model.robot import Clearance, Frame, Robot
from assembly.robots import load_robot
from assembly.statistics.experiment import Experiment
from assembly.statistics.requirement import Requirement
from forcefit.inputs.table import BadInput
from tests.robots_for_tests import coaxial_beams
from tests.tolerances_for_tests import PLAY, arm, plan_for, rigid_pair

K = np.array([1e6, 4e6])  # [N/m] of both springs at either posture
ENDS = [("one", 3), ("two", 3)]
LIMITS = {"margin": 2.0, "energy": 1e-3, "force": 50.0}


def springs(k, clearance=PLAY):
    """Two bars that meet on the x axis, with clearance between them."""
    play = None if clearance is None else Clearance(radial=clearance)
    return coaxial_beams(np.zeros(6), (k, k), clearance=play)


@pytest.fixture(scope="module")
def requirement():
    """The springs of the second posture are four times as stiff."""
    postures = [home_posture(springs(k)) for k in K]
    return Requirement(postures, plan_for(postures[0].robot, ENDS, [1, 1], LIMITS))


def test_utilisations_are_quantities_over_limits_posture_by_posture(requirement, rng):
    """Beyond the clearance p: d/p, k (d - p)^2 / 4, k (d - p) / 2."""
    values = rng.uniform(-4, 4, size=(530, 2)) * PLAY
    d = np.abs(values[:, 0] - values[:, 1])
    pressed = np.maximum(d - PLAY, 0.0)
    expected = [d / PLAY / 2.0] * 2
    expected += [k * pressed**2 / 4 / 1e-3 for k in K]
    expected += [k * pressed / 2 / 50.0 for k in K]
    assert requirement.cases == [(key, i) for key in LIMITS for i in (0, 1)]
    for found in requirement.utilisations(values):
        assert found.shape == (6, 530)
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


def test_slopes_of_a_utilisation_are_those_of_its_quantity_over_its_limit(requirement):
    """At d = 3 clearances: 1/p, k (d - p) / 2 and k / 2, of either sign."""
    values = np.array([[2.0, -1.0], [-1.0, 2.0]]) * PLAY
    for case, (key, i) in enumerate(requirement.cases):
        slope = {
            "margin": 1 / PLAY, "energy": K[i] * PLAY, "force": K[i] / 2,
        }[key] / LIMITS[key]  # fmt: skip
        found = requirement.utilisation_slopes(case, values)
        np.testing.assert_allclose(found, slope * np.array([[1, -1], [-1, 1]]), 1e-6)


def test_draws_that_do_not_close_exceed_every_limit():
    """Rigid parts without clearance: only equal errors of both fit."""
    robot = rigid_pair()
    plan = plan_for(robot, ENDS, [1, 1], {"energy": 1.0, "force": 1.0})
    requirement = Requirement([home_posture(robot)], plan)
    for found in requirement.utilisations(np.array([[1e-4, 1e-4], [1e-4, 2e-4]])):
        np.testing.assert_array_equal(np.isinf(found), [[False, True]] * 2)


def test_draws_of_random_clearance_are_the_same_in_one_batch_and_in_several():
    """The clearance of draw 515 is its own, whatever is solved with it."""
    posture = home_posture(arm(radial=PLAY))
    plan = plan_for(posture.robot, [("tip", 3)], [1], {"translation": 1e-3},
                    clearance_model="contact")  # fmt: skip
    values = np.linspace(-1e-3, 1e-3, 516)[:, None]
    _, found = Requirement([posture], plan).utilisations(values)
    rows = Experiment(posture, plan.sources, clearance_model="contact").evaluate(
        values, range(516)
    )
    np.testing.assert_allclose(found[0], rows["translation"] / 1e-3, rtol=1e-9)
    # clearance of 0.1 mm beside an error of 1 mm
    assert np.ptp(found[0, -8:] - np.abs(values[-8:, 0]) / 1e-3) > 0.01


def test_the_stress_of_a_limit_is_that_of_the_most_stressed_link(rng):
    posture = place_robot(load_robot("irsbot2"), {"tx": 0.1, "tz": -0.5})
    robot = posture.robot
    links = [f"leg{leg}.{link}" for leg in (1, 2) for link in ("link_a", "link_b")]
    plan = plan_for(robot, [(link, 3) for link in links], [1] * 4,
                    {"margin_free": 3.0, "stress": 5e6})  # fmt: skip
    values = rng.uniform(-2e-3, 2e-3, size=(3, 4))
    _, found = Requirement([posture], plan).utilisations(values)
    for errors, share in zip(plan.sources.errors(values), found[1], strict=True):
        answer = solve_assembly(replace(posture, robot=robot.with_errors(errors)))
        largest = peak_stresses(robot, answer.wrenches).max()
        assert share == pytest.approx(largest / 5e6, rel=1e-2)


def test_a_limit_that_no_result_meets_is_refused_before_the_work():
    posture = home_posture(springs(1e6))
    plan = plan_for(posture.robot, ENDS, [1, 1], {"margin": 1.0, "stress": 1e6})
    with pytest.raises(BadInput, match="limit stress: no link of beams has a shape"):
        Requirement([posture], plan).experiments  # noqa: B018


@pytest.mark.parametrize(
    ("limits", "worst_play", "refused"),
    [
        ({"translation": 0.9 * PLAY}, True, True),
        ({"translation": 1.1 * PLAY}, True, False),
        ({"translation": 0.9 * PLAY}, False, False),
        ({"energy": 1.0}, True, False),
    ],
)
def test_a_limit_within_the_clearance_of_perfect_parts_is_refused(
    limits, worst_play, refused
):
    """Of two postures that of more clearance is named; only where all of it counts."""
    postures = [home_posture(arm(radial=0.5 * PLAY)), home_posture(arm(radial=PLAY))]
    plan = plan_for(postures[0].robot, [("tip", 3)], [1], limits,
                    clearance_model="worst" if worst_play else "least")  # fmt: skip
    requirement = Requirement(postures, plan)
    if not refused:
        reached = requirement.perfect_parts()
        assert all(value <= limits[key] for key, (value, _) in reached.items())
        return
    with pytest.raises(BadInput) as error:
        requirement.perfect_parts()
    assert str(error.value) == (
        "limit translation: even perfect parts reach 0.0001 m by clearances alone at "
        "tx = 0.4; expected at most 9e-05 m (or --clearance least, if clearances stay "
        "as solved)"
    )


@pytest.mark.parametrize(
    ("limit", "places", "named"),
    [
        ("margin", [("one", 3), ("one", 5), ("two", 3)], "one.TZ"),
        ("margin", [("one", 3), ("two", 4)], None),
        ("margin", [("two", 3), ("slanted", 3)], "slanted.TX"),
        ("energy", [("two", 4)], "two.TY"),
    ],
)
def test_an_error_that_nothing_takes_up_is_named(limit, places, named):
    """Play in x and y takes up no error along z, and stores no energy.

    Nor an error along x of a frame turned by 1e-3 rad about y, of which 1e-3 is in z.
    """
    frames = (
        Frame("slanted", translation=[0.5, 0, 0], rotation=[0, 1e-3, 0]),
        Frame("one", "slanted", rotation=[0, -1e-3, 0]),
        Frame("two", "base", [0.5, 0, 0]),
        Frame("end", "one", clearance=Clearance(radial=PLAY)),
    )
    robot = Robot("pin", "end", frames, (("end", "two"),))
    plan = plan_for(robot, places, [1] * len(places), {limit: 1.0})
    requirement = Requirement([home_posture(robot)], plan)
    if named is None:
        requirement.check_taken_up()
        return
    with pytest.raises(BadInput) as error:
        requirement.check_taken_up()
    assert str(error.value) == (
        f"limit {limit}: no clearance or spring takes up an error {named}; leave "
        "it out, or limit the energy of a robot that is elastic there"
    )
