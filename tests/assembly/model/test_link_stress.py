"""Peak stress of links, compared with formulas."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from forcefit.assembly.files.solved_links import solve_links
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.model.link_stress import peak_stresses, stressed_links
from forcefit.assembly.model.robot import BeamLink, Frame, MatrixLink, MeshLink, Robot
from forcefit.assembly.robots import load_robot
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.monte_carlo import draws_dataset
from forcefit.assembly.sweeps.plan import Sweep
from forcefit.assembly.sweeps.quantities import Question
from forcefit.assembly.sweeps.sweep import sweep_in_memory
from forcefit.assembly.sweeps.targets import grid_targets, parse_grid

PLAIN = Path(__file__).parents[3] / "meshes" / "distal_plain.stl"


def two_bars(gap):
    """Return two coaxial bars between walls with a gap."""
    bar = BeamLink({"radius": 0.01}, 70e9, 0.3)
    frames = (
        Frame("one", translation=[0.5, 0, 0], link=bar),
        Frame("mount", translation=[1.0, 0, 0]),
        Frame("two", "mount", [-0.5, 0, 0], link=bar, geometric_error=gap),
        Frame("end_one", "one"),
        Frame("end_two", "two"),
    )
    return Robot("bars", "end_one", frames, (("end_one", "end_two"),))


def test_stress_of_stretched_bars_equals_modulus_times_strain():
    robot = two_bars([0, 0, 0, 1e-4, 0, 0])
    answer = solve_assembly(place_robot(robot))
    # The strain is 1e-4 m / 1 m in both bars.
    stress = peak_stresses(robot, answer.wrenches)
    np.testing.assert_allclose(stress, 70e9 * 1e-4, rtol=1e-9)


def test_von_mises_stress_of_a_bar_equals_formulas():
    """The bending stress at the base is sigma = 4 F L / (pi r^3)."""
    robot = two_bars(np.zeros(6))
    w = np.zeros((3, 5, 6))
    w[0, 2, 4], w[1, 2, 5], w[2, 2, 0] = 100.0, -100.0, 10.0
    expected = 4 * 100.0 * 0.5 / (np.pi * 0.01**3)
    stress = peak_stresses(robot, w)
    np.testing.assert_allclose(stress[:2, 1], expected, rtol=1e-9)
    # The torsional stress is tau = 2 T / (pi r^3), and the von Mises stress is sqrt(3)
    # tau.
    twist = np.sqrt(3) * 2 * 10.0 / (np.pi * 0.01**3)
    assert stress[2, 1] == pytest.approx(twist, rel=1e-9)
    assert not stress[:, 0].any()


def test_links_without_a_section_have_no_stress():
    robot = load_robot("irsbot2")
    known = [link.frame for link in stressed_links(robot)]
    assert known == [f.name for f in robot.frames if isinstance(f.link, BeamLink)]
    matrix = robot.with_links({known[0]: MatrixLink(np.eye(6))})
    assert [link.frame for link in stressed_links(matrix)] == known[1:]


@pytest.mark.slow
def test_finite_element_stress_agrees_with_beam_theory():
    """The stress is F / A, and F (L - r) / W for bending.

    Points within one radius r of the base are omitted.  At this distance, the effect of
    the clamped end has decayed to 3.9 % (Saint-Venant).
    """
    link = MeshLink(PLAIN, "z=0", "z=0.452", 6e10, 0.3)
    frame = Frame("distal", translation=[0.452, 0, 0], link=link)
    robot = solve_links(Robot("one", "distal", (frame,)))
    (frame,) = robot.frames
    w = np.zeros((2, 1, 6))
    w[0, 0, 3], w[1, 0, 5] = 1000.0, 1000.0
    r = 0.04
    expected = [1000 / (np.pi * r**2), 4000 * (0.452 - r) / (np.pi * r**3)]
    found = peak_stresses(robot, w)[:, 0]
    assert 1.0 <= found[0] / expected[0] <= 1.05
    # The error estimate is for unit wrenches, including bending and torsion.
    told = stressed_links(robot)[0].relative_error
    assert 0.001 < told < 0.2
    drive = Frame("drive", joint="revolute", actuated=True)
    turned = Robot("one", "distal", (drive, replace(frame, parent="drive")))
    targets = grid_targets(parse_grid("q.drive=0:1:0.5", turned))
    question = Question(turned, components=targets.names, strength=2e8)
    data = sweep_in_memory(Sweep(question, targets))
    np.testing.assert_allclose(data["stress_error"].squeeze(), told, rtol=1e-9)
    assert found[1] == pytest.approx(expected[1], rel=0.03)
    beam = replace(frame, link=BeamLink({"radius": r}, 6e10, 0.3))
    whole = peak_stresses(Robot("one", "distal", (beam,)), w)[:, 0]
    assert whole[1] == pytest.approx(4000 * 0.452 / (np.pi * r**3), rel=1e-9)


def heavy(pinned):
    """Return a square bar of 20 mm x 1 m, clamped at one end or pinned at both ends."""
    link = BeamLink({"width": 0.02, "height": 0.02}, 2e11, 0.3, density=7850.0)
    if not pinned:
        return Robot("sag", "tip", (Frame("tip", translation=[1, 0, 0], link=link),))
    turn = [np.pi / 2, 0, 0]
    frames = (
        Frame("a", rotation=turn, joint="revolute"),
        Frame("tip", "a", [1, 0, 0], joint="revolute", link=link),
        Frame("end", "tip"),
        Frame("ground", translation=[1, 0, 0], rotation=turn),
    )
    return Robot("pinned", "end", frames, (("end", "ground"),))


@pytest.mark.parametrize(("pinned", "share"), [(False, 2), (True, 8)])
def test_stress_under_self_weight_equals_beam_theory(pinned, share):
    """The stress is 6 M / h^3 with M = W L / 2 at the wall or W L / 8 at midspan."""
    robot, gravity = heavy(pinned), [0, 0, -9.81]
    weight = 7850 * 0.02**2 * 9.81
    expected = 6 * weight / share / 0.02**3
    answer = solve_assembly(home_posture(robot), gravity=gravity)
    found = peak_stresses(robot, answer.wrenches, answer.frame_loads.at_tips)
    assert found[0] == pytest.approx(expected, rel=1e-9)


def test_stress_in_sweeps_and_draws_includes_link_weight():
    """The moment is W L / 2 at the base and zero at the tip."""
    turned = Frame("drive", joint="revolute", actuated=True)  # about z
    bar = replace(heavy(pinned=False).frames[0], parent="drive")
    robot = Robot("sag", "tip", (turned, bar))
    expected = 6 * 7850 * 0.02**2 * 9.81 / 2 / 0.02**3
    gravity = (0, 0, -9.81)
    targets = grid_targets(parse_grid("q.drive=0:1:0.5", robot))
    question = Question(
        robot, components=targets.names, strength=2e8, gravity=gravity,
        wrenches=("tip",),
    )  # fmt: skip
    data = sweep_in_memory(Sweep(question, targets))
    np.testing.assert_allclose(data["stress"].squeeze(), expected, rtol=1e-9)
    assert (data["stress_error"] == 0).all()  # formulas have no mesh error
    assert np.abs(data["wrench"]).max() < 1e-9
    sources = tolerance_sources(robot, [0, 0, 0, 1e-4, 0, 0])
    experiment = Experiment(home_posture(robot), sources, gravity=gravity)
    rows = experiment.solve(0, 2)
    np.testing.assert_allclose(rows["stress"][:, 0], expected, rtol=1e-9)
    errors = draws_dataset(experiment, rows)["stress"].attrs["estimated_relative_error"]
    assert errors.tolist() == [0.0]  # formulas have no mesh error
    weight = 7850 * 0.02**2 * 9.81  # [N] force that the drive transmits
    np.testing.assert_allclose(rows["force"], weight, rtol=1e-9)
    np.testing.assert_allclose(rows["moment"], weight / 2, rtol=1e-9)


def test_stress_and_safety_in_sweeps_equal_single_solutions():
    robot = load_robot("irsbot2")
    errors = np.zeros_like(robot.errors)
    errors[robot.index("leg1.link_a"), 3] = 1e-3
    robot = robot.with_errors(errors)
    targets = grid_targets(parse_grid("tx=0:0.1:0.1,tz=-0.5"))
    question = Question(robot, components=targets.names, strength=2e8)
    data = sweep_in_memory(Sweep(question, targets))
    for x in (0.0, 0.1):
        posture = place_robot(robot, pose={"tx": x, "tz": -0.5})
        expected = peak_stresses(robot, solve_assembly(posture).wrenches)
        here = data.sel(tx=x, method="nearest").squeeze()
        np.testing.assert_allclose(here["stress"], expected, rtol=1e-4)
        assert float(here["safety"]) == pytest.approx(2e8 / expected.max(), rel=1e-4)
        assert expected.max() > 1e5
