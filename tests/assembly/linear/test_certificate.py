"""Certificates of minimum energy and platform screw, and the effect of round-off."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture, place_robot, together
from forcefit.assembly.linear.certificate import bound_screw, unproved, unproved_screw
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly, together_at
from forcefit.assembly.linear.reference.as_printed import energy_as_printed
from forcefit.assembly.model.clearance import CONES, clearance_bounds
from forcefit.assembly.model.links import joint_compliances, link_compliances
from forcefit.assembly.model.robot import BeamLink, Frame, MatrixLink, Robot
from forcefit.assembly.statistics.linear_response import linear_response
from tests.robots_for_tests import (
    NUMBERS,
    assemble_at,
    coaxial_beams,
    irsbot2_with,
    random_robot,
)


def test_solution_with_nan_or_wrong_values_is_not_certified():
    answer = solve_assembly(place_robot(irsbot2_with(NUMBERS["cases"][0])))
    for spoilt_answer in (
        replace(answer, multipliers=answer.multipliers * np.nan),
        replace(answer, elastic=answer.elastic * np.nan),
        replace(answer, clearances=answer.clearances * np.nan),
    ):
        assert unproved(spoilt_answer)
    weaker = replace(answer, multipliers=0.9 * answer.multipliers)
    assert "the minimum energy is certified to within" in unproved(weaker)
    assert "stays open" in unproved(replace(answer, elastic=1.1 * answer.elastic))
    assert "exceeded by" in unproved(replace(answer, clearances=2 * answer.clearances))


def arm_against_wall(young, soft=50.0):
    """Return a bar between a soft hinge and a wall with errors of 0.1 and 0.2 mm."""
    K = np.diag([np.inf, np.inf, soft, np.inf, np.inf, np.inf])
    bar = BeamLink({"radius": 0.01}, young, 0.3, theory="euler")
    frames = (
        Frame("hinge", joint="revolute", joint_stiffness=K),
        Frame("side", "hinge"),
        Frame("tip", "hinge", [0.5, 0, 0], link=bar, joint="revolute"),
        Frame("end", "tip"),
        Frame("wall", translation=[0.5, 0, 0],
              geometric_error=[0, 0, 0, -1e-4, 2e-4, 0]),
    )  # fmt: skip
    return home_posture(Robot("arm", "side", frames, (("end", "wall"),)))


@pytest.mark.parametrize("young", [7e10, 1e16, 1e20, 1e22, 1e30, 1e38])
def test_hinge_rotation_error_is_within_its_bound_or_uncertified(
    young,
):
    """A transverse force F rotates the hinge by t = F L / K and bends the bar by F L^3
    / (3 E I), with t L + F L^3 / (3 E I) = 0.2 mm.
    """
    if young >= 1e30:
        with pytest.raises(CannotAssemble, match="the stiffest spring is 3e"):
            solve_assembly(arm_against_wall(young))
        return
    answer = solve_assembly(arm_against_wall(young))
    give = 0.5**2 / 50.0 + 0.5**3 / (3 * young * np.pi * 0.01**4 / 4)
    turn = 2e-4 / give * 0.5 / 50.0
    off, bound = abs(answer.platform_screw[2] - turn), bound_screw(answer)
    assert off <= bound.rotation + 1e-15
    assert bound.rotation_open == 0.0
    assert unproved(answer) == ""
    assert bound.rotation_error < 1e-8


def test_platform_screw_computed_by_cvxpy_is_within_the_certified_bound():
    """The tolerance of cvxpy, 1e-8 J, is added to the uncertainty."""
    compared = 0
    for seed in range(16):
        rng = np.random.default_rng(seed)
        posture = home_posture(random_robot(rng, 2, 3))
        try:
            answer = solve_assembly(posture)
        except CannotAssemble:
            continue
        energy, screw = energy_as_printed(posture)
        # The bound is also valid for assemblies whose energy exceeds the minimum by the
        # uncertainty.
        worse = replace(answer, multipliers=answer.multipliers)
        worse.__dict__["uncertainty"] = answer.uncertainty + max(
            energy - answer.bound, 1e-9 * answer.energy_without_clearance
        )
        bound = bound_screw(worse)
        off = screw - answer.platform_screw
        assert np.linalg.norm(off[:3]) <= bound.rotation + 1e-9
        assert np.linalg.norm(off[3:]) <= bound.translation + 1e-9
        compared += answer.energy > 0
    assert compared > 10


def test_errors_that_sum_to_round_off_cause_no_energy():
    """The errors 0.1, 0.2 and -0.3 mm do not sum to zero in floating point."""
    parts = [1e-4, 2e-4, -3e-4]
    frames = [Frame("f0", translation=[0.1, 0, 0], link=MatrixLink(1e6 * np.eye(6)))]
    for i, error in enumerate(parts):
        frames.append(Frame(f"f{i + 1}", f"f{i}", [0.1, 0, 0],
                            geometric_error=[0, 0, 0, error, 0, 0]))  # fmt: skip
    frames.append(Frame("wall", translation=[0.4, 0, 0]))
    robot = Robot("loop", "f3", tuple(frames), (("f3", "wall"),))
    posture = home_posture(robot)
    assert sum(parts) != 0.0
    answer = solve_assembly(posture)
    assert answer.energy == 0.0
    assert not answer.wrenches.any()
    assert assemble_at(robot, posture.transforms[None]).energy[0] == 0.0
    drawn = linear_response(posture).solve(robot.errors[None])
    assert drawn.energy[0] == 0.0
    # A small energy that is not round-off is preserved: k g^2 / 2 of one spring.
    for gap in (1e-6, 1e-12, 1e-17):
        frames[1] = replace(frames[1], geometric_error=[0, 0, 0, gap, 0, 0])
        small = replace(robot, frames=(*frames[:2], Frame("f3", "f1", [0.2, 0, 0]),
                                       frames[-1]))  # fmt: skip
        here = home_posture(small)
        for found in (
            solve_assembly(here).energy,
            assemble_at(small, here.transforms[None]).energy[0],
            linear_response(here).solve(small.errors[None]).energy[0],
        ):
            assert found == pytest.approx(1e6 * gap**2 / 2, rel=1e-9)


def test_duality_gap_of_wrong_multipliers_equals_hand_calculation():
    robot = coaxial_beams(np.array([0, 0, 0, 2e-4, 0, 0]), (1e6, 3e6))
    answer = solve_assembly(home_posture(robot))
    assert answer.duality_gap() < 1e-12 * answer.energy
    for wrong in (0.0, 0.9, 1.1, 2.0):
        spoilt = replace(answer, multipliers=answer.multipliers * wrong)
        # The complementary energy f g - f^2 C / 2 is too small by (wrong - 1)^2 times
        # the energy.
        expected = (wrong - 1) ** 2 * answer.energy
        assert spoilt.duality_gap() == pytest.approx(expected, rel=1e-9)
    stiffer = replace(answer, elastic=answer.elastic * 1.01)
    assert stiffer.duality_gap() == pytest.approx(0.0201 * answer.energy, rel=1e-6)
    assert stiffer.closure_residual() > 1e-7


def test_rotation_and_translation_have_separate_tolerances():
    """The tolerance is 1e-5 plus 1e-3 times the value."""
    gap = np.array([0.2, 0, 0, 0, 0, 0])
    assembly = solve_assembly(home_posture(coaxial_beams(gap)))
    assert np.abs(assembly.platform_screw[0]) == pytest.approx(0.1)
    open_ = replace(bound_screw(assembly), rotation_error=9e-5, translation_error=2e-5)
    (sentence,) = unproved_screw(assembly, open_)
    assert (
        "translation is certified to within 2.0e-05 m only, expected 1.0e-05 m"
        in sentence
    )
    open_ = replace(open_, rotation_error=2e-4, translation_error=9e-6)
    (sentence,) = unproved_screw(assembly, open_)
    assert (
        "rotation is certified to within 2.0e-04 rad only, expected 1.1e-04 rad"
        in sentence
    )


def disturbed(rng, seed):
    """Return the assembly of a random robot, and its perturbed solution."""
    robot = random_robot(np.random.default_rng(seed), 2, link_share=0.8)
    load = rng.normal(size=6) * [1, 1, 1, 10, 10, 10]
    best = solve_assembly(home_posture(robot), load)
    other = replace(
        best,
        elastic=best.elastic + 1e-2 * rng.normal(size=best.elastic.shape),
        clearances=0.3 * rng.normal(size=best.clearances.shape),
        motions=best.motions + 1e-4 * rng.normal(size=best.motions.shape),
        multipliers=best.multipliers + 0.1 * rng.normal(size=best.multipliers.shape),
    )
    return best, other


def bound_by_hand(assembly):
    """Return the sum of -w.dl - w C w / 2 - clearance work - |w q| over the frames."""
    robot, total = assembly.posture.robot, 0.0
    C_link, C_joint = link_compliances(robot), joint_compliances(robot)
    bounds = clearance_bounds(robot)
    free = (assembly.joints.free * np.abs(assembly.motions)).sum(axis=1).reshape(-1, 6)
    for i in range(len(robot.frames)):
        w, j = assembly.wrenches[i], assembly.joint_wrenches[i]
        total -= w @ robot.errors[i] + w @ C_link[i] @ w / 2 + j @ C_joint[i] @ j / 2
        for size, rows in zip(bounds[i], CONES, strict=True):
            unbounded = free[i, list(rows)].any() or not np.isfinite(size)
            total -= 0.0 if unbounded else size * np.linalg.norm(j[list(rows)])
        total -= np.abs(j) @ free[i]
    return total


SEEDS = (1, 3, 4, 6, 9, 12)


def solvable(rng):
    """Yield the assemblies of random robots that can be assembled."""
    for seed in SEEDS:
        try:
            yield disturbed(rng, seed)
        except (ValueError, RuntimeError):
            continue


def test_arbitrary_wrenches_give_a_lower_bound_on_the_energy(rng):
    """By weak duality, the sum over the frames is a lower bound."""
    some = list(solvable(rng))
    assert len(some) >= 3
    assert any(len(other.motions) for _, other in some)
    for best, other in some:
        bounded = replace(other, motions=best.motions)
        scale = best.energy_without_clearance + abs(best.work)
        assert bounded.bound <= best.potential + 1e-9 * scale
        by_hand = bound_by_hand(other)
        assert other.bound == pytest.approx(by_hand, rel=1e-9, abs=1e-9 * scale)


def test_combined_solutions_have_the_certificates_of_the_points():
    """The bound equals the energy minus the gap."""
    robot = coaxial_beams([0, 0, 0, 1e-4, 0, 0])
    best = solve_assembly(home_posture(robot))
    worse = replace(best, elastic=1.001 * best.elastic)
    found = together_at(together([best.posture] * 2), (best, worse))
    gaps = [best.duality_gap(), worse.duality_gap()]
    assert found.duality_gap() == pytest.approx(gaps)
