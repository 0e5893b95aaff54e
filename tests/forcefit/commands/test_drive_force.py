"""Option ``--drive-force``, and key ``drive_force`` in robot files."""

import csv
import json

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.model.force_control import with_drive_forces
from forcefit.assembly.model.robot import Frame, Robot
from tests.assembly.linear.test_drive_forces import crossed_cranks

# force in the coupler [N] due to 12 N m on a crank of 0.3 m at 60 degrees
FORCE = 12 / (0.3 * np.sin(np.pi / 3))
SHORTER = FORCE * 0.5 / (7e10 * np.pi * 0.004**2)  # [m] shortening of the coupler


@pytest.fixture
def path(tmp_path):
    write_robot(crossed_cranks(), tmp_path / "cranks.toml")
    return tmp_path / "cranks.toml"


@pytest.mark.parametrize("state", ["contact", "exact"])
def test_solve_reports_forces_due_to_a_drive_force(run, path, state):
    words = ["solve", path, "--drive-force", "rocker=12", "--state", state]
    status, out, _ = run("assembly", *words, "--json", "-")
    answer = json.loads(out)
    assert status == 0
    wrench = answer["frames"]["coupler"]["wrench"]
    assert wrench[3] == pytest.approx(-FORCE, rel=1e-4 if state == "exact" else 1e-9)
    assert answer["energy"] == pytest.approx(FORCE * SHORTER / 2, rel=1e-4)
    if state == "contact":
        _, out, _ = run("assembly", *words)
        remark = "drives that apply a force and hold no coordinate: rocker 12 N m"
        assert remark in out


def test_pose_error_includes_the_drive_force(run, path):
    status, out, _ = run(
        "assembly", "error", path, "--drive-force", "rocker=12", "--json", "-"
    )
    answer = json.loads(out)
    assert status == 0
    assert set(answer["error"]) == {"frozen", "free"}  # budget does not allow a load
    # the coupler is inclined, so that its end moves by more than its shortening
    upper = answer["error"]["frozen"]["translation"]["upper"]
    assert upper == pytest.approx(SHORTER / np.sin(np.pi / 3), rel=1e-6)


def test_deflection_curve_includes_the_drive_force(run, path):
    words = ["deflection", path, "--drive-force", "rocker=12", "--along", "fx=0:10:5"]
    status, out, _ = run("assembly", *words, "--json", "-")
    start = json.loads(out)["deflection"][0]
    assert status == 0
    assert start == pytest.approx(-SHORTER, rel=1e-9)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["solve", "--drive-force", "roker=1"], 'no drive "roker"; did you mean'),
        (["solve", "--drive-force", "pin=1"], 'no drive "pin"; valid: '),
        (["solve", "--drive-force", "rocker=x"], "--drive-force"),
        (["solve", "--drive-force", "rocker=1", "--joint", "rocker=1"],
         'no actuated joint "rocker"'),
        (["stiffness", "--drive-force", "rocker=1", "--by", "crank.mass"],
         "--by: found together with --drive-force"),
    ],
)  # fmt: skip
def test_invalid_drive_force_has_a_one_line_message(run, path, words, message):
    command, *options = words
    status, out, err = run("assembly", command, path, *options)
    assert (status, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1


def test_robot_with_only_force_controlled_drives_has_no_equilibrium(run, path):
    words = ["solve", path, "--drive-force", "rocker=12,crank=1", "--json", "-"]
    status, out, _ = run("assembly", *words)
    answer = json.loads(out)
    assert status == 1
    assert answer["status"] == "no equilibrium"
    assert (
        "the load drives a motion that no joint or spring resists" in answer["reason"]
    )


def test_sweep_can_vary_the_drive_force(run, path, tmp_path):
    """The energy is proportional to the squared force."""
    robot = with_drive_forces(crossed_cranks(), {"rocker": 1.0})
    write_robot(robot, tmp_path / "driven.toml")
    words = [tmp_path / "driven.toml", "--grid", "q.crank=1", "--assumption", "none",
             "--vary", "rocker.drive_force=0:20:10", "-o", tmp_path / "out.nc",
             "--csv", tmp_path / "out.csv"]  # fmt: skip
    status, _, _ = run("assembly", "sweep", *words)
    assert status == 0
    with (tmp_path / "out.csv").open() as file:
        energies = [float(row["energy [J]"]) for row in csv.DictReader(file)]
    force = 10 / (0.3 * np.sin(1.0))
    expected = force**2 * 0.5 / (7e10 * np.pi * 0.004**2) / 2
    np.testing.assert_allclose(energies, [0, expected, 4 * expected], rtol=1e-9)


def test_study_rejects_a_robot_with_drive_force(run, tmp_path):
    robot = with_drive_forces(crossed_cranks(), {"rocker": 1.0})
    write_robot(robot, tmp_path / "driven.toml")
    (tmp_path / "study.toml").write_text('robot = "driven.toml"\n')
    status, out, err = run("study", tmp_path / "study.toml")
    assert (status, out) == (2, "")
    assert "study.toml: robot: found a robot with drive_force; expected one" in err


def test_frequency_excludes_stiffness_of_force_controlled_drive(run, tmp_path):
    """A slide of mass m has the frequency sqrt(k / m) / (2 pi)."""
    stiff = np.diag([np.inf] * 5 + [3e6])
    rail = {"joint": "prismatic", "actuated": True}
    robot = Robot("slide", "block", (
        Frame("first", joint_stiffness=stiff, **rail),
        Frame("block", "first", mass=2.0),
        Frame("second", joint_stiffness=2 * stiff, **rail),
        Frame("end", "second"),
    ), (("block", "end"),))  # fmt: skip
    write_robot(robot, tmp_path / "slide.toml")
    for words, k in (([], 9e6), (["--drive-force", "second=50"], 3e6)):
        status, out, _ = run(
            "assembly", "frequencies", tmp_path / "slide.toml", *words, "--json", "-"
        )
        expected = np.sqrt(k / 2.0) / (2 * np.pi)
        assert status == 0
        assert json.loads(out)["frequencies"] == pytest.approx([expected], rel=1e-9)


@pytest.mark.exudyn
def test_drive_force_results_agree_with_exudyn(run, path):
    status, out, _ = run(
        "validation", "crosscheck", path, "--drive-force", "rocker=12", "--json", "-"
    )
    answer = json.loads(out)
    assert status == 0
    assert answer["passed"]
    ours, theirs = (
        answer["scales"][0][key]["platform_screw"] for key in ("vjm", "multibody")
    )
    np.testing.assert_allclose(ours, theirs, atol=1e-9)
