"""Worst pose errors of serial arms, four-bar linkages and platforms on legs."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from forcefit import BadInput, Clearance, Frame, Robot, worst_pose
from forcefit.assembly.callouts.callout import Callout, Datum
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.statistics.callout_sources import sources_of
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.responses import respond
from forcefit.stiffness.screws import rotation_matrix, rotation_vector
from tests.drawn_four_bar_for_tests import four_bar_file
from tests.tolerances_for_tests import two_links, without_clearances

FIRST, SECOND = np.radians(30.0), np.radians(45.0)
PIN = Clearance(radial=10e-6)
# arm with links of 0.4 m at 30 deg and 0.3 m at 75 deg
SERIAL = two_links(FIRST, SECOND, 50e-6, PIN, PIN)


def of_serial():
    angles = tolerance_sources(SERIAL, np.eye(6)[2] * 1e-4, ("shoulder", "elbow"))
    return linear_response(home_posture(SERIAL)), sources_of(SERIAL, angles)


def test_worst_case_of_a_serial_arm_agrees_with_nonlinear_geometry():
    """The largest error of 156.18 um occurs for positive length errors and negative
    angle errors. The clearances add 10 um each.
    """
    found = worst_pose(*of_serial(), "translation")
    assert found.reading == "linear"
    corners = []
    for s in itertools.product((-1, 1), repeat=4):
        a, b = 0.4 + s[0] * 50e-6, 0.3 + s[1] * 50e-6
        first = FIRST + s[2] * 1e-4
        second = first + SECOND + s[3] * 1e-4
        corners.append([a * np.cos(first) + b * np.cos(second),
                        a * np.sin(first) + b * np.sin(second)])  # fmt: skip
    home = [0.4 * np.cos(FIRST) + 0.3 * np.cos(FIRST + SECOND),
            0.4 * np.sin(FIRST) + 0.3 * np.sin(FIRST + SECOND)]  # fmt: skip
    finite = np.linalg.norm(np.array(corners) - home, axis=1).max() + 20e-6
    assert found.attained == pytest.approx(finite, abs=0.03e-6)
    assert found.attained == pytest.approx(156.18e-6, abs=0.005e-6)
    assert found.bound == pytest.approx(found.attained, rel=1e-3)
    angle = np.degrees(np.arctan(found.direction[1] / found.direction[0]))
    assert angle == pytest.approx(9.8, abs=0.05)
    assert sum(share for _, share in found.shares) == pytest.approx(156.18e-6, rel=1e-4)
    assert " 156.2 um" in repr(found)


def test_worst_case_of_two_ball_clearances_is_the_sum_of_their_radii():
    """The error is the same in all directions."""
    balls = tuple(
        Callout(name, feature, (Datum(datum, "point"),), shape="point",
                widths={"position": width})
        for name, feature, datum, width in (
            ("arm", "elbow", "shoulder", 40e-6), ("hand", "tip", "elbow", 30e-6),
        )
    )  # fmt: skip
    robot = replace(without_clearances(SERIAL), callouts=balls)
    found = worst_pose(home_posture(robot))
    assert found.attained == pytest.approx(35e-6, rel=1e-9)
    assert found.bound == pytest.approx(35e-6, rel=1e-9)


def test_rms_error_of_a_serial_arm_equals_hand_calculation():
    """The root mean square of 58.9 um is computed from the variances of errors and
    clearances.
    """
    prepared, sources = of_serial()
    draws = prepared.solve(sources.errors(sources.draw(0, 50_000, 1)))
    square = (draws.platform_screw[:, 3:] ** 2).sum(axis=1).mean()
    # A uniform clearance of radius R adds R^2/2.
    assert np.sqrt(square + 2 * 10e-6**2 / 2) == pytest.approx(58.9e-6, rel=0.01)


def with_half_of_the_coupler(sources):
    """Return error sources for a platform in the middle of the coupler."""
    robot, placed = sources.robot, []
    for one in sources.placed:
        errors = one.errors.copy()
        if "coupler" in one.name:
            errors[robot.index("C")] /= 2
            errors[robot.index("coupler")] = errors[robot.index("C")]
        placed.append(replace(one, errors=errors))
    return replace(sources, placed=tuple(placed))


def four_bar(tmp_path, clearance):
    path = tmp_path / "four_bar.toml"
    path.write_text(four_bar_file(clearance))
    robot = read_robot(path)
    return linear_response(home_posture(robot)), sources_of(robot)


@pytest.mark.parametrize(
    ("clearance", "mrad"), [("", 0.1903), ("radial = 10e-6", 0.3595)]
)
def test_largest_rotation_of_a_four_bar_coupler_equals_hand_calculation(
    tmp_path, clearance, mrad
):
    """Errors contribute 0.1903 mrad and clearances 0.1692 mrad."""
    found = worst_pose(*four_bar(tmp_path, clearance), "rotation")
    assert found.attained * 1e3 == pytest.approx(mrad, abs=5e-5)
    assert found.attained <= found.bound <= found.attained * 1.001


@pytest.mark.parametrize(("clearance", "um"), [("", 38.4), ("radial = 10e-6", 67.35)])
def test_largest_displacement_of_a_four_bar_point_equals_hand_calculation(
    tmp_path, clearance, um
):
    """The point is in the middle of the coupler and moves by half of the length
    error.
    """
    prepared, sources = four_bar(tmp_path, clearance)
    sources = with_half_of_the_coupler(sources)
    found = worst_pose(prepared, sources)
    assert found.attained * 1e6 == pytest.approx(um, abs=0.03)
    # The contribution of clearances is 29.2 um.
    none = tuple(replace(one, errors=0 * one.errors) for one in sources.placed)
    alone = worst_pose(prepared, replace(sources, placed=none))
    assert alone.attained * 1e6 == pytest.approx(29.24 if clearance else 0, abs=0.005)


def test_random_draws_of_the_four_bar_stay_below_its_worst_case(tmp_path):
    """Of 10^6 random draws, 99.73 % are below 42.9 um and the largest is 60 um. The
    worst case is 67.35 um.
    """
    prepared, sources = four_bar(tmp_path, "radial = 10e-6")
    sources = with_half_of_the_coupler(sources)
    count, discs = 1_000_000, int(prepared.starts[-1])
    screws = prepared.screws[3:5]
    moved = (
        sources.draw(0, count, 1)
        @ (screws[:, discs:] @ sources.maps.reshape(-1, len(sources))).T
    )
    rng = np.random.default_rng(2)
    for first, last in zip(prepared.starts[:-1], prepared.starts[1:], strict=True):
        radius = np.sqrt(rng.random(count))
        angle = rng.uniform(0, 2 * np.pi, count)
        disc = radius * np.stack([np.cos(angle), np.sin(angle)])
        assert last - first == 2
        moved += disc.T @ screws[:, first:last].T
    sizes = 1e6 * np.linalg.norm(moved, axis=1)
    assert np.quantile(sizes, 0.9973) == pytest.approx(42.9, abs=0.15)
    assert sizes.max() == pytest.approx(60.0, abs=2.0)
    assert sizes.max() < 67.35


STIFF = [np.inf] * 5 + [1e6]
HEAD = rotation_matrix([0, np.pi / 2, 0]) @ rotation_matrix([np.pi / 2, 0, 0])


def on_springs(positions, clearance, stiffness=STIFF):
    """Return a platform on legs that translates along z and rotates about y."""
    frames = [
        Frame("lift", joint="prismatic"),
        Frame("turn", "lift", rotation=np.array([-np.pi / 2, 0, 0]), joint="revolute"),
        Frame("plate", "turn", rotation=np.array([np.pi / 2, 0, 0])),
    ]
    closures = []
    for k, s in enumerate(positions):
        leg = f"leg{k}"
        K = None if stiffness is None else np.diag(stiffness)
        frames += [
            # The foot has an error and a spring along z.
            Frame(f"{leg}.foot", translation=np.array([s, 0, 0]), joint_stiffness=K,
                  clearance=Clearance(axial=clearance) if clearance else None),
            Frame(f"{leg}.slide", f"{leg}.foot", rotation=np.array([0, np.pi / 2, 0]),
                  joint="prismatic"),
            Frame(f"{leg}.hinge", f"{leg}.slide",
                  rotation=np.array([np.pi / 2, 0, 0]), joint="revolute"),
            Frame(f"{leg}.head", f"{leg}.hinge"),
            Frame(f"{leg}.seat", "plate", np.array([s, 0, 0]), rotation_vector(HEAD)),
        ]  # fmt: skip
        closures.append((f"{leg}.head", f"{leg}.seat"))
    robot = Robot("springs", "plate", tuple(frames), tuple(closures))
    feet = tuple(f"leg{k}.foot" for k in range(len(positions)))
    return robot, tolerance_sources(robot, np.eye(6)[5] * 50e-6, feet)


def test_worst_cases_of_four_springs_equal_hand_calculation():
    """For legs at -0.3, -0.1, 0.1 and 0.3 m, errors of 50 um and clearances of 20 um,
    the rotation is 233 urad (rigid), 240 urad (equilibrium) and 280 urad (bound).
    """
    robot, sources = on_springs((-0.3, -0.1, 0.1, 0.3), 20e-6)
    found = worst_pose(home_posture(robot), sources, "rotation")
    assert found.reading == "equilibrium"
    assert found.rigid * 1e6 == pytest.approx(233.3, abs=0.5)
    assert found.attained * 1e6 == pytest.approx(240, abs=0.5)
    assert found.bound * 1e6 == pytest.approx(280, abs=0.5)


def test_worst_equilibrium_is_not_exceeded_at_corners_or_inside():
    """All 16 corners and 500 points inside the tolerance box are evaluated."""
    robot, sources = on_springs((-0.3, -0.1, 0.1, 0.3), 20e-6)
    prepared = linear_response(home_posture(robot))
    found = worst_pose(prepared, sources, "rotation")
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=4)))
    inner = np.random.default_rng(1).uniform(-1, 1, (500, 4))
    sizes, _ = respond(
        prepared, sources, 50e-6 * np.vstack([corners, inner]), "rotation"
    )
    assert sizes.max() <= found.attained + 1e-9


def test_response_of_springs_without_clearance_is_linear():
    """The rotation is sum(s d) / sum(s^2) = 50 um * 0.8 m / 0.2 m^2 = 200 urad."""
    robot, sources = on_springs((-0.3, -0.1, 0.1, 0.3), 0.0)
    found = worst_pose(home_posture(robot), sources, "rotation")
    assert found.reading == "elastic"
    assert found.attained == pytest.approx(200e-6, rel=1e-6)
    assert found.bound == pytest.approx(200e-6, rel=1e-3)


def test_worst_case_of_rigid_legs_equals_hand_calculation():
    """Two rigid legs are not over-constrained and allow 2 * 70 um / 0.6 m = 233.3 urad.
    A third leg in the middle does not reduce the rotation.
    """
    for positions, reading in [((-0.3, 0.3), "linear"), ((-0.3, 0.0, 0.3), "rigid")]:
        robot, sources = on_springs(positions, 20e-6, None)
        found = worst_pose(home_posture(robot), sources, "rotation")
        assert found.reading == reading
        assert found.attained == pytest.approx(140e-6 / 0.6, rel=1e-4)
        assert found.bound == pytest.approx(140e-6 / 0.6, rel=1e-3)


def test_unbounded_errors_and_loads_are_rejected():
    robot, sources = on_springs((-0.3, 0.3), 20e-6)
    posture = home_posture(robot)
    unbounded = replace(sources, kind=np.full(len(sources), 1))
    with pytest.raises(BadInput, match="leg0.foot.TZ, which is unbounded"):
        worst_pose(posture, unbounded)
    loaded = linear_response(posture, load=(0, 0, 0, 0, 0, -10))
    with pytest.raises(BadInput, match="found a load, expected none"):
        worst_pose(loaded, sources)
