"""Results without geometric errors: contributions of clearances and loads."""

import numpy as np
import pytest

from forcefit import load_robot, worst_pose, write_robot
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.model.joint_names import joint_of
from forcefit.assembly.statistics.callout_sources import sources_of
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.perfect_parts import perfect_parts
from tests.guided_stage_for_tests import STAGE
from tests.pages_for_tests import tiles
from tests.tolerances_for_tests import ARM, arm

RADIAL, TILT = 1e-4, 2e-3
ERRORS = 'errors = [{ frames = ["tip"], most = [0, 0, 0, 1e-6, 1e-6, 1e-6] }]'


def experiment(robot, **options):
    sources = tolerance_sources(robot, [0, 0, 0, 1e-6, 1e-6, 1e-6], ("tip",))
    return Experiment(home_posture(robot), sources, margins=False, **options)


def test_clearance_contributions_of_a_pin_sum_to_the_largest_error():
    """The displacements r and L t are perpendicular, so the error is hypot(r, L t) with
    contributions in the ratio r^2 : (L t)^2.
    """
    parts = perfect_parts(experiment(arm(radial=RADIAL, tilt=TILT)))
    largest = np.hypot(RADIAL, ARM * TILT)
    translation = parts["translation"]
    assert translation["reached"] == pytest.approx(largest, abs=2e-6)
    by_kind = translation["clearances"]
    assert by_kind["pin.radial"] == pytest.approx(RADIAL**2 / largest, rel=1e-3)
    assert by_kind["pin.tilt"] == pytest.approx((ARM * TILT) ** 2 / largest, rel=1e-3)
    assert list(by_kind) == ["pin.tilt", "pin.radial"]
    assert parts["rotation"]["clearances"] == pytest.approx({"pin.tilt": TILT})


def test_parallel_displacements_of_ball_and_pin_add_up():
    """Both displacements are parallel, so the contributions are b and L t."""
    translation = perfect_parts(experiment(arm(ball=RADIAL, tilt=TILT)))["translation"]
    by_kind = translation["clearances"]
    assert translation["reached"] == pytest.approx(RADIAL + ARM * TILT, abs=2e-6)
    assert by_kind["pin.ball"] == pytest.approx(RADIAL, rel=1e-3)
    assert by_kind["pin.tilt"] == pytest.approx(ARM * TILT, rel=1e-3)


@pytest.mark.parametrize("name", ["irsbot2", "delta", "hexapod"])
def test_clearance_contributions_of_a_loop_sum_to_the_largest_error(name):
    """The largest error is a homogeneous function of the clearances."""
    robot = load_robot(name)
    pose = {"tx": 0.1, "tz": -0.5} if name == "irsbot2" else None
    posture = place_robot(robot, pose=pose) if pose else home_posture(robot)
    sources = tolerance_sources(robot, [1e-6] * 6)
    parts = perfect_parts(Experiment(posture, sources, precision=(1e-8, 1e-8)))
    for key in ("rotation", "translation"):
        total = sum(parts[key]["clearances"].values())
        assert total == pytest.approx(parts[key]["reached"], rel=5e-3)


def test_results_without_errors_include_displacement_under_load():
    """A force of 5 N along y moves the pin by its radial clearance."""
    parts = perfect_parts(experiment(arm(radial=RADIAL), load=(0, 0, 0, 0, 5.0, 0)))
    assert parts["translation"]["reached"] == pytest.approx(RADIAL, rel=1e-6)
    assert parts["force"]["reached"] == pytest.approx(5.0)
    assert "clearances" not in parts["translation"]


@pytest.mark.parametrize("limit", [5e-4, 2e-3])
def test_advice_names_clearances_that_exceed_the_limit(tmp_path, run, limit):
    """Clearances move the tip by 0.806 mm, and errors only by 1 um."""
    write_robot(arm(radial=RADIAL, tilt=TILT), tmp_path / "arm.toml")
    (tmp_path / "errors.toml").write_text(ERRORS)
    page = tmp_path / "page.html"
    status, text, err = run(
        "assembly", "statistics", tmp_path / "arm.toml", "--errors",
        tmp_path / "errors.toml", "--draws", 40, "--importance", 16, "--limit",
        f"translation={limit}", "--report", page,
    )  # fmt: skip
    assert status == 0, err
    answer, _ = tiles(page.read_text("utf-8"))["Tolerance to tighten"]
    broken = limit < np.hypot(RADIAL, ARM * TILT)
    assert ("exceeds the limit of" in text) == broken
    assert answer == ("the clearances" if broken else "nothing")
    assert "perfect parts, clearances alone: rotation of 0.002 rad (pin.tilt" in text


def test_pose_error_of_a_free_platform_is_reported_as_unbounded(tmp_path, run):
    """The platform is on an arm with a passive hinge without a motion limit."""
    write_robot(arm(passive=True, radial=RADIAL), tmp_path / "arm.toml")
    (tmp_path / "errors.toml").write_text(ERRORS)
    status, text, err = run(
        "assembly", "statistics", tmp_path / "arm.toml", "--errors",
        tmp_path / "errors.toml", "--draws", 20, "--limit", "translation=1e-3",
        "--report", tmp_path / "page.html",
    )  # fmt: skip
    assert status == 0, err
    assert "a translation without bound exceeds the limit of 0.001 m" in text


def test_motion_of_a_passive_joint_has_a_separate_contribution():
    """The motion limit contributes 0.4 mm, and the radial clearance 0.1 mm."""
    parts = perfect_parts(experiment(arm(passive=True, radial=RADIAL, spin=1e-3)))
    by_kind = parts["translation"]["clearances"]
    assert by_kind == pytest.approx(
        {"own motion of passive joints": ARM * 1e-3, "pin.radial": RADIAL}, rel=1e-2
    )


# [rad, m] Largest value and contribution of each joint, computed independently with
# cvxpy. A contribution is the derivative with respect to the logarithm of the
# clearance.
WORST = {
    "rotation": (1.34029e-3, {
        "clearance of x": 0.92274e-3, "clearance of y": 0.24606e-3,
        "profile of sole": 0.09187e-3, "clearance of foot": 0.07962e-3,
    }),
    "translation": (226.746e-6, {
        "clearance of x": 135.245e-6, "profile of sole": 42.605e-6,
        "clearance of foot": 36.924e-6, "clearance of y": 11.972e-6,
    }),
}  # fmt: skip


@pytest.fixture
def stage(write_file):
    """Return an over-constrained stage with clearances in guides."""
    return read_robot(write_file(STAGE))


@pytest.mark.parametrize("quantity", WORST)
def test_contributions_to_a_rigid_worst_case_are_listed_by_joint(stage, quantity):
    found = worst_pose(home_posture(stage), quantity=quantity)
    value, parts = WORST[quantity]
    assert found.reading == "rigid"
    assert found.attained == pytest.approx(value, rel=1e-5)
    assert dict(found.shares) == pytest.approx(parts, rel=1e-3)
    assert sum(dict(found.shares).values()) == pytest.approx(value, rel=1e-3)


def test_every_contact_belongs_to_a_joint(stage):
    owners = {joint_of(stage, row) for row, f in enumerate(stage.frames) if f.clearance}
    assert owners == {"x", "y", "foot"}


def test_clearance_contributions_are_listed_by_joint(stage):
    reached = perfect_parts(Experiment(home_posture(stage), sources_of(stage)))
    parts = reached["rotation"]["clearances"]
    assert set(parts) <= {"x.clearance", "y.clearance", "foot.clearance"}
    assert sum(parts.values()) == pytest.approx(
        reached["rotation"]["reached"], rel=1e-3
    )
