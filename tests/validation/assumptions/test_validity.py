"""Tests of the errors caused by modelling assumptions."""

import json
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.evidence.validity_models import bush_margin, halves_cost, with_bars
from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.closure import virtual_joints
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.model.links import link_compliance
from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, Robot
from forcefit.assembly.robots import load_robot
from forcefit.validation.assumptions.bushes import bush_joints, solve_bushes
from forcefit.validation.assumptions.solid_links import solid_link
from forcefit.validation.assumptions.validity import (
    closure_cost,
    link_cost,
    pieces_cost,
    spread_cost,
)
from forcefit.validation.crosscheck.pair import scaled
from forcefit.validation.crosscheck.spread_weight import energy_between_ends
from forcefit.validation.multibody.simulation import SimulationModel, simulate_assembly
from tests.robots_for_tests import NUMBERS, irsbot2_with

E, NU, RHO = 60e9, 0.3, 2700.0
FLAT = BeamLink({"width": 0.02, "height": 0.05}, E, NU, density=RHO)
LOOSE = Clearance(radial=3e-5, tilt=7.5e-4)  # bushes at +-40 mm


def cantilever(link=FLAT, length=0.5):
    frame = Frame("tip", translation=[length, 0, 0], link=link)
    return home_posture(Robot("cantilever", "tip", (frame,)))


def pin(error):
    """Return a pin with clearance between two misaligned rigid bodies."""
    frames = (
        Frame("pin", clearance=LOOSE, geometric_error=error),
        Frame("end", "pin"),
        Frame("wall"),
    )
    return home_posture(Robot("pin", "end", frames, (("end", "wall"),)))


@pytest.fixture(scope="module")
def posture():
    """Return the IRSBot-2 with the errors of the paper."""
    return place_robot(irsbot2_with(NUMBERS["cases"][0]), {"tx": 0.1, "tz": -0.45})


@pytest.mark.parametrize(
    ("shift", "tilt"), [((2e-5, 0), (0, 3e-4)), ((0, 1e-5), (-6e-4, 0))]
)
def test_margin_of_two_bushes_is_the_sum_of_the_ratios(shift, tilt):
    """With independent bounds, the margin is the larger of the two ratios."""
    at = pin([*tilt, 0, *shift, 0])
    r, theta = np.hypot(*shift) / 3e-5, np.hypot(*tilt) / 7.5e-4
    assert zone_margin(at).margin == pytest.approx(max(r, theta), rel=1e-9)
    assert bush_margin(at) == pytest.approx(r + theta, rel=1e-9)


def test_energy_with_bushes_is_between_those_of_independent_bounds(posture):
    """Energy and margin are between those of the paper's bounds."""
    frames = tuple(
        replace(f, clearance=replace(
            f.clearance, radial=f.clearance.radial / 2, tilt=f.clearance.tilt / 2
        )) if f.clearance else f
        for f in posture.robot.frames
    )  # fmt: skip
    half = replace(posture, robot=replace(posture.robot, frames=frames))
    bushes = solve_bushes(posture).energy
    assert solve_assembly(posture).energy < bushes < solve_assembly(half).energy
    assert solve_bushes(posture).relative_gap() < 1e-9
    for compliant in ("rigid", "free"):
        disc = zone_margin(posture, compliant).margin
        assert disc <= bush_margin(posture, compliant) <= 2 * disc


def test_bushes_do_not_change_joints_without_tilt_clearance():
    robot = load_robot("hexapod")  # its joints have radial and axial clearance
    joints = virtual_joints(robot)
    np.testing.assert_array_equal(bush_joints(joints).cones, joints.cones)


@pytest.mark.exudyn
@pytest.mark.slow
def test_energy_ratio_of_two_bushes_agrees_with_simulation(posture):
    """The energies with and without bushes are compared at small errors."""
    expected = solve_bushes(posture).energy / solve_assembly(posture).energy
    scale = 1 / 16
    disc, bushes = (
        simulate_assembly(
            posture, scale, SimulationModel(clearances=True, bushes=b)
        ).rigid_energy
        for b in (False, True)
    )
    assert expected > 1.02
    assert bushes / disc == pytest.approx(expected, rel=2e-3)


def test_half_weights_at_the_ends_overestimate_the_sag():
    """The deflection is q L^4 / 6 EI instead of q L^4 / 8 EI."""
    L, g = 0.5, 9.81
    link = replace(FLAT, theory="euler")
    cost = halves_cost(cantilever(link), [0, 0, -g])
    second = 0.02**3 * 0.05 / 12  # the height of 0.05 m is along y
    q = RHO * 1e-3 * g
    sag, slope = q * L**4 / (8 * E * second), q * L**3 / (6 * E * second)
    assert cost.position == pytest.approx(sag / 3, rel=1e-9)
    assert cost.rotation == pytest.approx(slope / 2, rel=1e-9)
    # the energies are (qL/2)^2 L^3 / 6 EI and q^2 L^5 / 40 EI
    assert cost.energy == pytest.approx((1 / 24) / (1 / 40) - 1, rel=1e-9)


def test_energy_of_a_heavy_cantilever_equals_closed_form():
    """The energy is q^2 L^5 / 40 EI, with q^2 L^5 / 1440 EI between the ends."""
    L, g = 0.5, 9.81
    at = cantilever(replace(FLAT, theory="euler"))
    second, q = 0.02**3 * 0.05 / 12, RHO * 1e-3 * g
    between = energy_between_ends(at, [0, 0, -g])
    ends = solve_assembly(at, gravity=[0, 0, -g]).energy
    assert between == pytest.approx(q**2 * L**5 / (1440 * E * second), rel=1e-12)
    assert ends + between == pytest.approx(q**2 * L**5 / (40 * E * second), rel=1e-9)
    assert spread_cost(at, [0, 0, -g]).energy == pytest.approx(1 / 36, rel=1e-9)


@pytest.mark.exudyn
@pytest.mark.parametrize("elements", [1, 2, 8])
def test_energy_of_a_heavy_cantilever_agrees_with_simulation(
    elements,
):
    """Exudyn neglects the energy within an element."""
    at, g = cantilever(), 1e-3 * np.array([3.0, -5.0, 8.0])
    model = SimulationModel(elements=elements)
    energy = simulate_assembly(at, model=model, gravity=g).energy
    ends = solve_assembly(at, gravity=g).energy
    expected = ends + energy_between_ends(at, g, pieces=elements)
    assert energy == pytest.approx(expected, rel=1e-7)
    assert ends + energy_between_ends(at, g) >= energy


def test_error_of_a_link_model_is_zero_for_equal_stiffness(posture):
    """A matrix equal to K_E of the beam causes no error."""
    beams = {
        f.name: np.linalg.inv(link_compliance(f))
        for f in posture.robot.frames
        if f.link is not None
    }
    same = link_cost(posture, beams)
    assert same.energy < 1e-6
    assert same.position < 1e-9
    assert not same.matters
    assert link_cost(posture, {k: K / 2 for k, K in beams.items()}).matters


def test_error_of_linear_closures_is_of_second_order(
    posture,
):
    """Half of the errors and clearances cause a quarter of the position error."""
    full, half = closure_cost(posture), closure_cost(scaled(posture, 0.5))
    assert full.position / half.position == pytest.approx(4, rel=0.1)
    assert full.matters


@pytest.mark.usefixtures("coarse_solids")
def test_thick_bar_with_rigid_ends_is_stiffer_in_bending(posture):
    """A rigid end prevents warping in bending, but not in torsion.

    The bending stiffness is larger by the factor 1 + c r / L with c about 0.2.
    """
    thick = with_bars(posture.robot, 5.0).frame("leg1.link_a")
    assert isinstance(thick.link, BeamLink)
    thick = replace(thick, link=replace(thick.link, theory="timoshenko"))
    K, beam = solid_link(thick).condensed, np.linalg.inv(link_compliance(thick))
    assert K[0, 0] == pytest.approx(beam[0, 0], rel=2e-3)  # x is along the link
    for row in (1, 2):
        assert 1.01 < K[row, row] / beam[row, row] < 1.08
    # the solid is not more compliant than the beam in any direction
    stretch = np.linalg.eigvals(np.linalg.solve(beam, K)).real
    assert stretch.min() > 0.99
    assert stretch.max() < 1.15
    turned = replace(thick, rotation=np.zeros(3), translation=[0, 0.452, 0])
    values = np.linalg.eigvalsh(solid_link(turned).condensed)
    np.testing.assert_allclose(values, np.linalg.eigvalsh(K), rtol=1e-6)


def test_errors_of_assumptions_are_unknown_without_errors_and_load(run, tmp_path):
    """The energies of both models are round-off."""
    target = tmp_path / "costs.json"
    words = ["validity", "irsbot2", "--pose", "tx=0,tz=-0.5", "--json", target]
    status, out, _ = run("validation", *words)
    assert status == 1
    assert "beyond" not in out
    assert "nothing to compare" in out
    costs = json.loads(target.read_text())["costs"]
    assert "nothing to compare" in costs["linear closures"]["reason"]
    assert "nothing to compare" in costs["disc and cone, not two bushes"]["reason"]


def test_position_error_is_known_without_energy():
    """For a bar of length l rotated by t, the position error is l t^2 / 2."""
    frames = (
        Frame("a", geometric_error=[0, 0, 0.01, 0, 0, 0]),
        Frame("b", "a", translation=[0.5, 0, 0]),
    )
    cost = closure_cost(home_posture(Robot("bar", "b", frames)))
    assert cost.position == pytest.approx(0.5 * 0.01**2 / 2, rel=1e-3)
    assert np.isnan(cost.energy)
    assert cost.known
    assert cost.matters


def test_validity_command_marks_significant_errors(run, tmp_path):
    """Unknown errors have a reason."""
    target, file = tmp_path / "costs.json", tmp_path / "robot.toml"
    write_robot(irsbot2_with(NUMBERS["cases"][0]), file)
    words = ["validity", file, "--pose", "tx=0.1,tz=-0.45", "--load", "fz=-100"]
    status, out, _ = run("validation", *words, "--json", target)
    assert status == 0
    costs = json.loads(target.read_text())["costs"]
    assert costs["disc and cone, not two bushes"]["matters"]
    assert "--solids" in costs["beams, not solids"]["reason"]
    assert "no beam has a density" in costs["weight at the links' ends"]["reason"]
    assert "above 20 um or 1 %" in out


def test_error_with_suggested_beam_elements_is_below_20_um():
    """A moment bends the beam to a circular arc, so the exact solution is known.

    With half of the suggested number of elements, the error exceeds 20 um.
    """
    length, stiffness, angle = 1.0, 1e3, 0.2
    link = BeamLink({"width": 0.1, "height": 0.1}, 1.2e5 * stiffness, 0.0,
                    theory="euler")  # fmt: skip
    load = [0, 0, angle * stiffness / length, 0, 0, 0]
    exact = length * np.array([np.sin(angle) / angle - 1, (1 - np.cos(angle)) / angle])

    def off(count):
        cut = cantilever(replace(link, pieces=count), length)
        return np.linalg.norm(solve_exact(cut, load).platform_screw[3:5] - exact)

    cost = pieces_cost(cantilever(link, length), load)
    assert cost.position == pytest.approx(off(1), rel=0.01)
    assert cost.pieces > 4
    assert off(cost.pieces) < 20e-6 < off(cost.pieces // 2)
    assert pieces_cost(cantilever(link, length), np.multiply(load, 1e-4)).pieces == 1
