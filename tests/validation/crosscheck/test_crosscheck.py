"""Tests of cross-checks with correct and with wrong models."""

import math
from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.exact import exact
from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, Robot
from forcefit.assembly.robots import load_robot
from forcefit.validation.crosscheck.crosscheck import attempt, crosscheck
from tests.multibody_for_tests import block
from tests.mutations_for_tests import BEAM_MUTATIONS, MUTATIONS
from tests.robots_for_tests import with_frames, with_papers_errors

pytestmark = pytest.mark.exudyn

STEEL = BeamLink({"radius": 0.01}, 200e9, 0.3)
BENT = [1e-3, -2e-3, 1e-3, 1e-4, 2e-4, -1e-4]
LOAD = [5.0, -8.0, 3.0, 100.0, 300.0, -200.0]


def triangle(error):
    """Return two steel bars from a wall to the same tip, with three overconstraints."""
    pin = Clearance(radial=1e-5, tilt=1e-4)
    K = np.diag([1e4, 1e4, 3e2, 1e8, 1e8, 1e8])
    frames = (
        Frame("a", translation=[0.4, 0, 0], link=STEEL, geometric_error=error,
              joint="revolute", clearance=pin),
        Frame("a_tip", "a"),
        Frame("wall", translation=[0, 0.3, 0.1]),
        Frame("b", "wall", translation=[0.4, -0.3, -0.1], link=STEEL,
              joint="revolute", joint_stiffness=K),
        Frame("b_tip", "b"),
    )  # fmt: skip
    return home_posture(Robot("triangle", "a_tip", frames, (("a_tip", "b_tip"),)))


def test_pose_difference_of_irsbot2_has_slope_two(posture):
    """The limits of both models agree, too."""
    result = crosscheck(posture)
    assert result.passed
    for slope in result.metric.slopes.values():
        assert slope == pytest.approx(2.0, abs=0.1)
    # The extrapolation leaves a fourth-order term.
    assert max(check.value for check in result.metric.limits.values()) < 2e-5


@pytest.mark.slow
@pytest.mark.parametrize("signed", [False, True])
def test_crosscheck_passes_over_poses_and_draws(signed):
    robot = load_robot("irsbot2")
    for seed in range(3):
        for tx, tz in ((0.2, -0.45), (-0.4, -0.35), (0.1, -0.15), (-0.15, -0.6)):
            place = place_robot(
                with_papers_errors(robot, seed, signed=signed), {"tx": tx, "tz": tz}
            )
            assert crosscheck(place).passed, (seed, tx, tz)


def test_exact_model_explains_the_pose_difference(posture):
    """If links are beams, their finite bending remains."""
    springs = crosscheck(posture, links="spring")
    assert springs.passed
    assert max(springs.metric.unexplained.values()) < 1e-3
    beams = crosscheck(posture)
    assert max(beams.metric.unexplained.values()) < 0.1


def failed_checks(result):
    return [name for name, check in result.checks.items() if check.verdict == "fails"]


def test_crosscheck_fails_for_wrong_errors_in_the_exact_model(posture, monkeypatch):
    """The errors of the exact model are one per cent too large."""

    def wrong(place, *_, **__):
        robot = place.robot.with_errors(1.01 * place.robot.errors)
        return solve_exact(replace(place, robot=robot))

    monkeypatch.setattr("forcefit.validation.crosscheck.pair.solve_exact", wrong)
    result = crosscheck(posture, links="spring")
    assert failed_checks(result) == [
        "rotation that finite rotations do not explain",
        "translation that finite rotations do not explain",
    ]


@pytest.mark.parametrize("links", ["beam", "spring"])
def test_crosscheck_with_weight_passes(links):
    """The bars are heavy, and the centres of mass are not at the frame origins."""
    posture = triangle(BENT)
    posture = home_posture(with_frames(
        posture.robot, lambda f: f.link is not None, mass=3.0,
        link=replace(STEEL, density=7800.0), centre_of_mass=[0.02, 0.05, -0.03],
    ))  # fmt: skip
    check = crosscheck(posture, links=links, gravity=[1.0, -2.0, -9.81])
    assert check.passed, check.checks
    light = crosscheck(posture, links=links)
    moved = check.pairs[0].linear.platform_screw - light.pairs[0].linear.platform_screw
    assert np.abs(moved[3:]).max() > 1e-5
    assert (check.pairs[0].between > 0) == (links == "beam")
    if links == "spring":
        # both models use finite rotations
        assert max(check.metric.unexplained.values()) < 1e-3


def erring(name, density):
    """Return a built-in robot with heavy links and errors up to 2 mrad and 0.2 mm."""
    robot, rng = load_robot(name), np.random.default_rng(0)
    errors = np.zeros((len(robot.frames), 6))
    links = [f for f in robot.frames if isinstance(f.link, BeamLink)]
    for frame in links:
        size = np.array([2e-3] * 3 + [2e-4] * 3)
        errors[robot.index(frame.name)] = rng.uniform(-1, 1, 6) * size
    heavy = {f.name: replace(f.link, density=density) for f in links}
    return home_posture(robot.with_errors(errors).with_links(heavy))


@pytest.mark.parametrize("name", ["3rrr", "arm6"])
def test_exact_model_and_simulation_agree_under_weight_and_moment(name):
    """The moment is a couple of forces of constant direction in both models."""
    posture = erring(name, 2700.0)
    load = [1, 2, 3, 50, 20, -30]
    check = crosscheck(posture, links="spring", load=load, gravity=[2, -3, -9.81])
    assert check.passed, check.text()
    assert max(check.metric.unexplained.values()) < 1e-4


def test_crosscheck_fails_for_a_wrong_weight_in_the_exact_model(monkeypatch):
    """The weight in the exact model is 5 % too large."""
    right = exact.dead_loads
    monkeypatch.setattr(
        exact, "dead_loads",
        lambda at, w, b, g, p: right(at, w, b, 1.05 * np.asarray(g), p),
    )  # fmt: skip
    result = crosscheck(erring("3rrr", 2700.0), links="spring", gravity=[2, -3, -9.81])
    failed = failed_checks(result)
    assert failed
    assert all("do not explain" in name for name in failed)


@pytest.mark.slow
def test_free_rotation_of_rods_under_a_load_is_reported():
    """Under a load, the rods of the delta would rotate by radians about their axes.

    Weak springs then resist this motion in all models.
    """
    still = crosscheck(erring("delta", 1600.0), (1.0, 0.5))
    assert still.passed, still.text()
    assert not still.pairs[0].simulated.held
    load = [0, 0, 0, 50, 20, -9]
    pushed = crosscheck(erring("delta", 1600.0), (1.0, 0.5), load=load)
    assert all(pair.simulated.held for pair in pushed.pairs)
    assert "free motions have springs of" in pushed.text()
    assert max(check.value for check in pushed.metric.limits.values()) < 1e-3
    springs = crosscheck(erring("delta", 1600.0), (1.0, 0.5), load, links="spring")
    assert springs.passed, springs.text()
    shares = [c for k, c in springs.checks.items() if "do not explain" in k]
    assert [check.verdict for check in shares] == ["ok", "ok"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("load", [None, [0, 0, 0, 0, 0, -100.0]])
def test_crosscheck_of_a_delta_with_errors_of_3_mrad_passes(seed, load):
    """All models have the same weak springs on free rotations of the rods."""
    robot = load_robot("delta")
    sources = tolerance_sources(
        robot, [3e-3] * 3 + [0] * 3, [f.name for f in robot.frames]
    )
    errors = sources.errors(sources.draw(0, 1, seed))[0]
    check = crosscheck(home_posture(robot.with_errors(errors)), load=load)
    assert check.passed, check.text()


def test_smaller_scales_are_added_until_the_limit_is_decided(irsbot2):
    """With the two requested scales, the uncertainty of limits exceeds the bound."""
    at = place_robot(
        with_papers_errors(load_robot("irsbot2"), 0, signed=True), {"tx": 0, "tz": -0.5}
    )
    check = crosscheck(at, (1.0, 0.5))
    assert check.passed, check.text()
    assert check.asked == 2
    assert len(check.pairs) > 2
    table = check.table()
    assert [entry["scale"] for entry in table["scales"]] == [1.0, 0.5]
    assert table["added_scales"][0]["scale"] == 0.25
    assert table["verdict"] == "passed"


@pytest.mark.parametrize("name", [
    "lever arm one per cent short",
    pytest.param("links half a per cent stiff", marks=pytest.mark.slow),
])  # fmt: skip
def test_crosscheck_at_two_scales_fails_for_a_wrong_term(irsbot2, name, broken):
    broken(MUTATIONS[name])
    at = place_robot(irsbot2, {"tx": 0.1, "tz": -0.45})
    check, _ = attempt("irsbot2", lambda: crosscheck(at, (1.0, 0.5), LOAD))
    assert check is None or check.table()["verdict"] == "failed"


def test_crosscheck_without_clearances_ignores_clearances():
    """With the clearance of 10 um, an error of 8 um would require no energy."""
    check = crosscheck(triangle([0, 0, 0, 8e-6, 0, 0]))
    assert check.posture.robot.frame("a").clearance is None
    assert check.passed
    assert check.pairs[0].simulated.energy > 1e-6


def test_crosscheck_of_a_serial_robot_has_slope_two():
    frames = (
        Frame("a", geometric_error=[0.01, 0.02, 0.03, 1e-3, 0, 0]),
        Frame("b", "a", translation=[0.5, 0, 0],
              geometric_error=[0.02, -0.01, 0.01, 0, 1e-3, 0]),
    )  # fmt: skip
    check = crosscheck(home_posture(Robot("serial", "b", frames)))
    assert check.passed
    assert check.slope == pytest.approx(2.0, abs=0.1)
    assert check.pairs[0].simulated.energy == 0.0


def test_crosscheck_without_errors_and_load_has_no_signal():
    result = crosscheck(triangle(np.zeros(6)))
    assert {check.verdict for check in result.checks.values()} == {"no signal"}
    assert not result.passed
    assert result.table()["verdict"] == "no signal"
    assert "\nNOT CHECKED: no difference exceeds" in result.text()
    assert math.isnan(result.slope)
    assert result.metric.differences["translation"].max() < 1e-15  # round-off


def test_checks_without_signal_are_counted_separately():
    """No spring is loaded, so only the platform pose is compared."""
    error = [0.01, 0.02, 0.03, 1e-3, 0, 0]
    frame = Frame("a", translation=[0.5, 0, 0], link=STEEL, geometric_error=error)
    result = crosscheck(home_posture(Robot("bar", "b", (frame, Frame("b", "a")))))
    silent = {k for k, check in result.checks.items() if check.verdict == "no signal"}
    parts = ("link rotation", "link translation", "link moment", "link force", "energy")
    assert {f"limit of {part}" for part in parts} <= silent
    assert result.checks["limit of platform rotation"].verdict == "ok"
    assert result.passed
    outcome = result.text().splitlines()
    counted = f"{len(silent)} of {len(result.checks)}"
    assert outcome[-1] == f"passed; {counted} checks had no signal above the noise"


def test_crosscheck_that_fails_to_run_reports_its_status():
    check, failure = attempt("block", lambda: crosscheck(block()))
    assert check is None
    assert failure["status"] == "cannot assemble"
    assert failure["passed"] is False


# mutations that are tested by default: the smallest ones, and one of each kind
BY_DEFAULT = (
    "lever arm one per cent short", "links half a per cent stiff", "joints rigid",
    "axes of the frames forgotten", "second chain counted twice",
)  # fmt: skip


@pytest.mark.parametrize("mutation", [
    pytest.param(
        mutation, id=name, marks=[pytest.mark.slow] * (name not in BY_DEFAULT)
    )
    for name, mutation in MUTATIONS.items()
])  # fmt: skip
def test_crosscheck_fails_for_a_wrong_term_of_the_linear_model(
    irsbot2, mutation, broken
):
    """The simulation does not use any of these terms."""
    broken(mutation)
    posture = place_robot(irsbot2, {"tx": 0.1, "tz": -0.45})
    check, _ = attempt("irsbot2", lambda: crosscheck(posture, load=LOAD))
    assert check is None or not check.passed


def test_crosscheck_of_two_crossed_bars_passes():
    """The bars bend in both planes."""
    assert crosscheck(triangle(BENT), load=LOAD).passed


@pytest.mark.parametrize("mutation", BEAM_MUTATIONS.values(), ids=BEAM_MUTATIONS.keys())
def test_crosscheck_fails_for_a_wrong_beam_of_the_linear_model(mutation, broken):
    """The robot consists of two crossed bars."""
    broken(mutation)
    assert not crosscheck(triangle(BENT), load=LOAD).passed


def test_slope_figure_shows_the_measured_differences(posture):
    from forcefit.validation.crosscheck.plot import slope_figure

    check = crosscheck(posture, scales=(1.0, 0.5))
    panels = slope_figure(check).axes
    assert [p.get_title() for p in panels] == ["rotation", "translation"]
    shown = panels[0].lines[0].get_ydata()
    np.testing.assert_allclose(shown, 1e3 * check.metric.differences["rotation"])


@pytest.mark.parametrize(
    "name",
    ["four_bar", "five_bar", "3rrr", "orthoglide", "arm6",
     *(pytest.param(name, marks=pytest.mark.slow) for name in ("delta", "hexapod"))],
)  # fmt: skip
def test_crosscheck_of_every_built_in_robot_passes_under_a_load(name):
    """The drives are springs about one axis and rigid in other directions."""
    posture = home_posture(load_robot(name))
    check = crosscheck(posture, (1.0, 0.5, 0.25), load=[0, 0, 0, 10.0, 20.0, -50.0])
    assert check.passed, check.text()
    assert all(
        abs(slope - 2) < 0.1 for slope in check.metric.slopes.values() if slope == slope
    )
