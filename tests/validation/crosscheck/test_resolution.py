"""Tests of the smallest changes that a cross-check of two bars detects."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.model.robot import Clearance
from forcefit.validation.crosscheck import crosscheck
from forcefit.validation.crosscheck.clearance_metric import TOLERANCE, ClearanceMetric
from forcefit.validation.crosscheck.limits import LIMIT_TOLERANCE
from forcefit.validation.crosscheck.pair import Pair, scaled
from forcefit.validation.crosscheck.pose_metric import PoseMetric
from forcefit.validation.crosscheck.resolution import resolution_text, resolutions
from tests.robots_for_tests import coaxial_beams, with_frames

ERROR, CLEARANCE, STIFFNESS = 4e-4, 1e-4, 1e6  # [m], [m], [N/m]


def bars(clearance=CLEARANCE):
    """Return two bars along x with a misfit of 0.4 mm and a radial clearance."""
    loose = Clearance(radial=clearance) if clearance else None
    gap = [0, 0, 0, ERROR, 0, 0]
    return home_posture(coaxial_beams(gap, (STIFFNESS, STIFFNESS), clearance=loose))


def with_clearance(robot, clearance):
    return with_frames(robot, lambda f: f.clearance, clearance=clearance)


def found(posture, metric):
    """Return the smallest detectable changes by parameter name."""
    simulated = SimpleNamespace(held=False)
    pairs = tuple(
        Pair(s, solve_assembly(scaled(posture, s)), simulated, None) for s in (1.0, 0.5)
    )
    compared = metric(posture.robot, pairs)
    nothing = np.zeros(6), np.zeros(3)
    return {r.name: r for r in resolutions(posture, pairs, compared, *nothing)}


def with_clearances(robot, pairs):
    return ClearanceMetric(robot, pairs, True)


def without(robot, pairs):
    return PoseMetric(robot, pairs, True, False)


def test_smallest_detected_clearance_change_equals_closed_form():
    """A relative change d of c changes E = k (e - c)^2 / 4 by 2 c d / (e - c)."""
    by_name = found(bars(), with_clearances)
    (clearance,) = (r for r in by_name.values() if r.kind == "clearance")
    expected = TOLERANCE * (ERROR - CLEARANCE) / (2 * CLEARANCE)
    assert clearance.smallest == pytest.approx(expected, rel=0.02)
    assert clearance.by == "energy"
    assert (clearance.value, clearance.unproved) == (CLEARANCE, False)


def test_smallest_detected_error_change_equals_closed_form():
    """A relative change d of e changes E by 2 e d / (e - c)."""
    (error,) = (r for r in found(bars(), with_clearances).values() if r.kind == "error")
    expected = TOLERANCE * (ERROR - CLEARANCE) / (2 * ERROR)
    assert error.smallest == pytest.approx(expected, rel=0.02)


def test_smallest_detected_stiffness_change_is_twice_the_bound():
    """Each of the two equal springs in series stores half of the energy."""
    for clearance, metric, bound in (
        (CLEARANCE, with_clearances, TOLERANCE),
        (None, without, LIMIT_TOLERANCE),
    ):
        links = [r for r in found(bars(clearance), metric).values() if r.kind == "link"]
        assert len(links) == 2
        for link in links:
            assert link.smallest == pytest.approx(2 * bound, rel=0.02)


def test_unloaded_clearance_is_reported_as_unproved():
    """The bars are loaded along x, so a clearance of 20 um along z has no effect."""
    loose = Clearance(radial=CLEARANCE, axial=2e-5)
    posture = replace(bars(), robot=with_clearance(bars().robot, loose))
    by_name = found(posture, with_clearances)
    (axial,) = (r for name, r in by_name.items() if name.endswith(".axial"))
    assert axial.unproved
    (line,) = (x for x in resolution_text(list(by_name.values())) if "unproved" in x)
    assert axial.name in line
    assert f"1 of {len(by_name)} parameters" in line


@pytest.mark.slow
@pytest.mark.exudyn
@pytest.mark.parametrize(("share", "passed"), [(0.5, True), (2.0, False)])
def test_crosscheck_fails_above_the_smallest_detectable_change(
    monkeypatch, share, passed
):
    """The change is half or twice the smallest detectable change."""
    posture = bars()
    right = crosscheck.crosscheck(posture, clearances=True)
    (clearance,) = (r for r in right.resolutions if r.kind == "clearance")
    more = 1.0 + share * clearance.smallest
    simulate = crosscheck.simulate_assembly

    def wrong(given, *arguments, **options):
        (loose,) = (f.clearance for f in given.robot.frames if f.clearance)
        robot = with_clearance(given.robot, Clearance(radial=more * loose.radial))
        return simulate(replace(given, robot=robot), *arguments, **options)

    monkeypatch.setattr(crosscheck, "simulate_assembly", wrong)
    check = crosscheck.crosscheck(posture, clearances=True)
    assert right.passed, right.text()
    assert check.passed == passed, check.text()
