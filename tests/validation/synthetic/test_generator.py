"""Tests of simulated effects against closed-form solutions.

The robot of most tests is a drive that rotates a beam of length L = 0.5 m about z.  The
tip is at (L cos q, L sin q, 0).
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.model.robot import BeamLink, Frame, Robot
from forcefit.inputs.errors import BadInput
from forcefit.validation.synthetic.design import CampaignDesign
from forcefit.validation.synthetic.effects import Row
from forcefit.validation.synthetic.generator import Noise, generate_campaign
from forcefit.validation.synthetic.machine import Hidden, simulate_readings

pytestmark = pytest.mark.exudyn

L, E, NU, RHO = 0.5, 70e9, 0.33, 2700.0
RADIUS, BORE = 0.02, 0.015
AREA = math.pi * (RADIUS**2 - BORE**2)
SECOND = math.pi * (RADIUS**4 - BORE**4) / 4
M2 = (BORE / RADIUS) ** 2
KAPPA = (
    6 * (1 + NU) * (1 + M2) ** 2 / ((7 + 6 * NU) * (1 + M2) ** 2 + (20 + 12 * NU) * M2)
)
SHEAR = KAPPA * E / (2 * (1 + NU)) * AREA  # kappa G A
DRIVE = 2e4  # [N m/rad]
CONDITIONS = {"temperature": 5.0, "time": 300.0, "approach": -1.0, "humidity": 50.0}


def one_link(mass=0.0, error=None, drive=DRIVE):
    K = np.diag([np.inf, np.inf, drive, np.inf, np.inf, np.inf])
    frames = (
        Frame("drive", joint="revolute", actuated=True, joint_stiffness=K,
              geometric_error=np.zeros(6) if error is None else error),
        Frame("tip", "drive", translation=[L, 0, 0], mass=mass, link=BeamLink(
            {"radius": RADIUS, "inner_radius": BORE}, E, NU, density=RHO)),
    )  # fmt: skip
    return Robot("one_link", "tip", frames)


def row(q=0.0, load=(0, 0, 0, 0, 0, 0), **conditions):
    wrench = np.array(load, dtype=float)
    return Row({"drive": q, "tip": 0.0}, wrench, CONDITIONS | conditions)


@pytest.fixture(params=["multibody", "springs"])
def added(request):
    """Return a function that computes the contribution of an effect to a reading."""

    def difference(name, parameters, where, robot=None, program=request.param):
        case = robot or one_link(), np.zeros(3), [where]
        without = simulate_readings(*case, program=program)
        effects = [Hidden(name, parameters)]
        return (simulate_readings(*case, effects, program) - without)[0]

    return difference


def close(contribution, expected, relative, floor=1e-11):
    np.testing.assert_allclose(contribution, expected, rtol=relative, atol=floor)


@pytest.mark.parametrize("point", [(0, 0, 0), (0.1, -0.2, 0.05)])
def test_perfect_robot_without_load_has_no_deviation(point):
    readings = simulate_readings(one_link(), np.array(point), [row(0.4), row(-1.2)])
    assert np.abs(readings).max() < 1e-12


def test_reading_of_a_declared_error_equals_closed_form():
    """An error e about the drive axis moves the tip to L (cos, sin)(q + e)."""
    q, e = 0.3, 0.02
    contribution = simulate_readings(
        one_link(error=np.array([0, 0, e, 0, 0, 0])), np.zeros(3), [row(q)]
    )[0]
    dx, dy = math.cos(q + e) - math.cos(q), math.sin(q + e) - math.sin(q)
    close(contribution, [0, 0, e, L * dx, L * dy, 0], 1e-12)


@pytest.mark.parametrize("g", [9.81, 3.0])
def test_deflection_by_weight_equals_closed_form(added, g):
    """The shortening of the bent beam is below 2.4e-8 m."""
    w, m = RHO * AREA * g, 1.3
    sag = w * L**4 / (8 * E * SECOND) + w * L**2 / (2 * SHEAR)
    sag += m * g * (L**3 / (3 * E * SECOND) + L / SHEAR)
    slope = w * L**3 / (6 * E * SECOND) + m * g * L**2 / (2 * E * SECOND)
    contribution = added("self_weight", {"g.z": -g}, row(), one_link(mass=m))
    close(contribution, [0, slope, 0, 0, 0, -sag], 1e-5, 2.4e-8)


@pytest.mark.parametrize(
    ("name", "parameter", "longer"),
    [("thermal_expansion", 2e-5, 2e-5 * 5 * L), ("link_length", 3e-4, 3e-4)],
)
def test_longer_or_warmer_beam_moves_its_tip_along_its_axis(
    added, name, parameter, longer
):
    """A warm beam is longer by alpha T L."""
    q = 0.7
    contribution = added(name, {"tip": parameter}, row(q))
    close(contribution, longer * np.array([0, 0, 0, np.cos(q), np.sin(q), 0]), 1e-9)


def test_deflection_of_a_longer_beam_equals_closed_form(added):
    """The contribution is P ((L + d)^3 - L^3) / 3EI + P d / kGA."""
    P, d = 1.0, 1e-2
    contribution = added("link_length", {"tip": d}, row(load=(0, 0, 0, 0, 0, -P)))
    more = ((L + d) ** 3 - L**3) / (3 * E * SECOND) + d / SHEAR
    assert contribution[5] == pytest.approx(-P * more, rel=1e-4)


def test_rotation_of_an_elastic_drive_is_moment_over_stiffness(added):
    """The rotation is F L / k, in addition to that of the declared spring."""
    F, k = 10.0, 5e4
    contribution = added("drive_compliance", {"drive": k}, row(load=(0, 0, 0, 0, F, 0)))
    close(contribution[[2, 4]], [F * L / k, F * L**2 / k], 1e-4)


def test_tip_motion_by_base_compliance_equals_closed_form(added):
    """A force F along y at the tip causes F / k_t along y and F L / k_r about z."""
    F = 10.0
    springs = {"rx": 1e6, "ry": 1e6, "rz": 2e5, "tx": 1e8, "ty": 4e6, "tz": 1e8}
    given = {f"stiffness.{k}": v for k, v in springs.items()}
    contribution = added("base_compliance", given, row(load=(0, 0, 0, 0, F, 0)))
    close(contribution[[2, 4]], [F * L / 2e5, F / 4e6 + F * L**2 / 2e5], 1e-4)


@pytest.mark.parametrize("name", ["offset", "eccentricity", "wobble"])
def test_encoder_error_rotates_the_beam(added, name):
    """The tip is at L (cos, sin)(q + d)."""
    q, size, phase = 0.6, 2e-3, 0.9
    given = {"drive.amplitude": size, "drive.phase": phase}
    cases = {
        "offset": ("encoder_offset", {"drive": size}, size),
        "eccentricity": ("encoder_eccentricity", given, size * math.sin(q + phase)),
        "wobble": ("_second_harmonic", given, size * math.sin(2 * q + phase)),
    }
    effect, parameters, d = cases[name]
    contribution = added(effect, parameters, row(q))
    dx, dy = math.cos(q + d) - math.cos(q), math.sin(q + d) - math.sin(q)
    close(contribution, [0, 0, d, L * dx, L * dy, 0], 1e-9)


def test_registration_errors_move_device_frame_and_target(added):
    """The pose is B R, B (p + R tool) with a rotation b about z and a shift in B."""
    q, b, shift, tool = 0.5, 0.01, [1e-3, -2e-3, 3e-3], [2e-3, 0, 1e-3]
    given = {"base.rz": b, "base.tx": shift[0], "base.ty": shift[1]}
    given |= {"base.tz": shift[2], "tool.tx": tool[0], "tool.tz": tool[2]}
    contribution = added("registration", given, row(q))
    out = L + tool[0]
    x = out * math.cos(q + b) + shift[0] - L * math.cos(q)
    y = out * math.sin(q + b) + shift[1] - L * math.sin(q)
    close(contribution, [0, 0, b, x, y, shift[2] + tool[2]], 1e-12)


def test_deflection_of_a_softer_beam_equals_closed_form(added):
    """The factor f on E also multiplies G."""
    P, f = 1.0, 0.8
    contribution = added("modulus_scale", {"tip": f}, row(load=(0, 0, 0, 0, 0, P)))
    bend = P * L**3 / (3 * E * SECOND) + P * L / SHEAR
    assert contribution[5] == pytest.approx((1 / f - 1) * bend, rel=1e-7)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_load_moves_a_joint_to_the_bound_of_its_clearance(added, side):
    """A force along x moves the beam by the radial clearance along x."""
    clearance = {"drive.radial": 3e-5, "drive.axial": 1e-5, "drive.tilt": 0.0}
    contribution = added(
        "joint_clearance", clearance, row(load=(0, 0, 0, 20 * side, 0, 0))
    )
    close(contribution, [0, 0, 0, 3e-5 * side, 0, 0], 2e-3, 1e-8)


@pytest.mark.parametrize("approach", [1.0, -1.0])
def test_friction_rotates_an_elastic_joint_against_its_approach(added, approach):
    """The rotation about the joint axis is - tau approach / k."""
    tau = 0.5
    contribution = added("friction_hysteresis", {"drive": tau}, row(approach=approach))
    close(contribution[[2, 4]], np.array([1, L]) * -tau * approach / DRIVE, 1e-4)


@pytest.mark.parametrize("exponent", [1.5, 1.0, 2.0])
@pytest.mark.parametrize("force", [10.0, -0.1])
def test_deformation_of_a_contact_equals_its_power_law(added, exponent, force):
    """The additional rotation d satisfies F L = c d^n."""
    c = 2e7
    given = {"drive.coefficient": c, "drive.exponent": exponent}
    contribution = added("contact_stiffening", given, row(load=(0, 0, 0, 0, force, 0)))
    d = math.copysign((abs(force) * L / c) ** (1 / exponent), force)
    close(contribution[[2, 4]], [d, d * L], 1e-4)


def test_deflection_by_load_errors_equals_closed_form(added):
    """The contribution is ((f - 1) P + offset) (L^3/3EI + L/kGA)."""
    P, f, more = 2.0, 1.1, 0.3
    given = {"factor": f, "offset.fz": more}
    contribution = added("load_gain", given, row(load=(0, 0, 0, 0, 0, P)))
    bend = L**3 / (3 * E * SECOND) + L / SHEAR
    assert contribution[5] == pytest.approx(((f - 1) * P + more) * bend, rel=1e-7)


def test_drift_rises_exponentially(added):
    given = {"amplitude.ry": 2e-5, "amplitude.tz": -1e-5, "time_constant": 150.0}
    rise = 1 - math.exp(-2.0)  # relative drift at 300 s
    close(added("drift", given, row()), [0, 2e-5 * rise, 0, 0, 0, -1e-5 * rise], 1e-12)


@pytest.mark.parametrize("program", ["multibody", "springs"])
def test_geometric_stiffening_adds_the_finite_rotation(program):
    """A rotation e adds L (cos e - 1) along the beam and L (sin e - e) across it."""
    e = 0.02
    robot = one_link(error=np.array([0, 0, e, 0, 0, 0]))
    design = CampaignDesign(configurations=2, rows=2, load=0.0)
    wanted = [(Hidden("geometric_stiffening", {}), 5.0)]
    campaign = generate_campaign(robot, wanted, design, program=program, seed=3)
    for i, where in enumerate(campaign.plan.rows):
        q = where.coordinates["drive"]
        c, s = math.cos(q), math.sin(q)
        along, across = L * (math.cos(e) - 1), L * (math.sin(e) - e)
        expected = [0, 0, 0, c * along - s * across, s * along + c * across, 0]
        close(campaign.added[i], expected, 1e-4, 1e-9)
    assert campaign.strength["geometric_stiffening"] == pytest.approx(5.0, rel=1e-9)


def test_effects_outside_the_library_equal_closed_forms(added):
    """The effects are those of ``outside.py``."""
    q, F = 0.3, 10.0
    pushed = row(q, load=(0, 0, 0, -F * math.sin(q), F * math.cos(q), 0))
    turn = F * L / 1e5 * (1 + math.cos(3 * q)) / 2
    contribution = added("_pose_stiffness", {"drive": 1e5}, pushed)
    assert contribution[2] == pytest.approx(turn, rel=1e-4)
    assert added("_humidity", {"tip": 1e-5}, row())[3] == pytest.approx(10e-5 * L)
    warm = added("_quadratic_temperature", {"tip": 1e-6}, row())
    assert warm[3] == pytest.approx(25e-6 * L)
    heavy = row(load=(0, 0, 0, 30, 40, 0))
    stand = added("_stand", {"c.tx": 4e-6, "c.rz": -8e-6}, heavy)
    close(stand, [0, 0, -2e-6, 1e-6, 0, 0], 1e-12)
    close(added("_sag", {"rate": 1e-7}, heavy), [0, 0, 0, 0, 0, -5e-6], 1e-12)


def two_walls():
    """Return a point between two equal beams on prismatic drives along x."""
    link = BeamLink({"radius": 0.01}, E, NU)
    along = [0, math.pi / 2, 0]  # rotates z to x
    back = [0, -math.pi / 2, 0]
    frames = (
        Frame("left", rotation=along, joint="prismatic", actuated=True),
        Frame("a", "left", [0, 0, L], back,
              link=replace(link, length=L, axis=(1, 0, 0))),
        Frame("right", translation=[2 * L, 0, 0], rotation=along, joint="prismatic",
              actuated=True),
        Frame("b", "right", [0, 0, -L], back,
              link=replace(link, length=L, axis=(-1, 0, 0))),
    )  # fmt: skip
    return Robot("walls", "a", frames, (("a", "b"),))


def test_misfit_in_a_closed_loop_is_divided_between_equal_beams(added):
    """Each of the two equal beams takes up half of a misfit."""
    robot = two_walls()
    rest = {f.name: 0.0 for f in robot.frames}
    where = Row(rest, np.zeros(6), CONDITIONS)
    for name, given, expected in (
        ("link_length", {"a": 1e-4}, 0.5e-4),
        ("link_length", {"b": 1e-4}, -0.5e-4),
        ("encoder_offset", {"left": 1e-4}, 0.5e-4),
        ("thermal_expansion", {"a": 2e-5, "b": 2e-5}, 0.0),
    ):
        contribution = added(name, given, where, robot)
        close(contribution, [0, 0, 0, expected, 0, 0], 1e-3, 1e-10)
    F, k = 100.0, E * math.pi * 0.01**2 / L
    pulled = replace(where, load=np.array([0, 0, 0, F, 0, 0]))
    soft = added("modulus_scale", {"a": 0.5, "b": 0.5}, pulled, robot)
    assert soft[3] == pytest.approx(F / (2 * k), rel=1e-5)


@pytest.mark.parametrize(("make", "message"), [
    (lambda: Noise(position=0.0), "noise: position: found 0"),
    (lambda: Noise(missing=1.0), "noise: missing: found 1"),
    (lambda: Noise(hidden_frame=math.inf), "noise: hidden_frame: found inf"),
    (lambda: CampaignDesign(size=math.nan), "design: size: found nan"),
    (lambda: CampaignDesign(load=-1.0), "design: load: found -1"),
    (lambda: CampaignDesign(reference_point=(0.0, math.inf, 0.0)),
     "design: reference_point: found inf"),
])  # fmt: skip
def test_impossible_noise_or_design_is_rejected(make, message):
    with pytest.raises(BadInput) as caught:
        make()
    assert message in str(caught.value)


@pytest.mark.parametrize(("words", "message"), [
    (["--rotation", "-inf"], "rotation: found -inf"),
    (["--error-size", "nan"], "--error-size: found nan"),
    (["--outliers", "200"], "found 200, expected at most the 116 rows"),
    (["--seed", "-1"], "--seed"),
    (["--effect", "foo"], 'found "foo"'),
    (["--program", "x"], "multibody | springs"),
    (["--at", "1,2"], "three numbers"),
    (["--truth", "no/t.json"], "no folder no"),
])  # fmt: skip
def test_generate_rejects_invalid_options_and_writes_nothing(
    rejected, tmp_path, words, message
):
    folder, truth = tmp_path / "c", tmp_path / "t.json"
    generate = ["validation", "generate", "arm6", folder, "--truth", truth]
    assert message in rejected(*generate, "--program", "springs", *words)
    assert list(tmp_path.iterdir()) == []
