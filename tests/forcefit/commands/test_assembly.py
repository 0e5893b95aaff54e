"""Commands ``forcefit assembly error`` and ``forcefit assembly solve``."""

import json
from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.reference.pose_error import reachable_screws
from forcefit.assembly.robots import load_robot
from forcefit.inputs.table import BadInput
from tests.three_upu_for_tests import three_upu

ROBOT = ["irsbot2", "--pose", "tx=0.1,tz=-0.5"]


def test_error_along_a_direction_equals_python_result(run):
    status, out, _ = run(
        "assembly", "error", *ROBOT, "--assumption", "free", "--at", "x=0.1,z=-0.05",
        "--along", "tx=1,tz=-1", "--json", "-",
    )  # fmt: skip
    assert status == 0
    found = json.loads(out)
    posture = place_robot(load_robot("irsbot2"), pose={"tx": 0.1, "tz": -0.5})
    offset = posture.platform[:3, :3] @ [0.1, 0, -0.05]
    answer = solve_assembly(posture)
    expected = bound_pose_error(answer, "free", offset=offset)
    error = found["error"]["free"]
    assert error["translation"]["lower"] == pytest.approx(
        expected.translation_error[0], abs=1e-9
    )
    direction = np.array([0, 0, 0, 1, 0, -1]) / np.sqrt(2)
    assert found["direction"] == pytest.approx(direction.tolist())
    support = reachable_screws(answer, "free").at_point(offset).support(direction)
    assert error["along"]["upper"] == pytest.approx(support.height, rel=1e-9)
    assert error["along"]["lower"] == pytest.approx(support.height, rel=1e-6)
    screw = error["along"]["platform_screw"]
    assert direction @ screw == pytest.approx(error["along"]["lower"])
    assert error["along"]["upper"] <= error["translation"]["upper"]


def test_solve_reports_the_linearisation_error_under_gravity(run):
    gravity = ["--gravity", "z=-9.81", "--json", "-"]
    _, out, _ = run("assembly", "solve", "arm6", "--state", "exact", *gravity)
    exact = json.loads(out)
    here = solve_exact(home_posture(load_robot("arm6")), gravity=[0, 0, -9.81])
    assert exact["platform_screw"] == pytest.approx(here.platform_screw.tolist())
    assert exact["platform_screw"][5] < -5e-4
    _, out, _ = run("assembly", "solve", "arm6", *gravity)
    linear = json.loads(out)
    assert linear["linearisation_error"]["status"] == "ok"
    off = np.subtract(linear["platform_screw"], exact["platform_screw"])
    assert linear["linearisation_error"]["translation"] == pytest.approx(
        off[3:].tolist(), abs=1e-15
    )


def test_loaded_pose_error_is_sag_plus_clearance(run, tmp_path):
    """A pin with clearance is mounted on an elastic post under a downward load.

    The load moves the joint to its axial bound, so that only the radial clearance
    remains.  The post deflects by F / k.
    """
    (tmp_path / "post.toml").write_text("""
platform = "tip"
[[frame]]
name = "post"
parent = "base"
joint_stiffness = [1e6, 1e6, 1e6, 1e6, 1e6, 1e6]
clearance = { radial = 3e-5, axial = 2e-5 }
mass = 2.0
[[frame]]
name = "tip"
parent = "post"
mass = 3.0
""")
    words = ["assembly", "error", tmp_path / "post.toml", "--load", "fz=-20"]
    _, out, _ = run(*words, "--json", "-")
    found = json.loads(out)
    assert list(found["error"]) == ["frozen", "free"]
    assert found["load"] == [0, 0, 0, 0, 0, -20]
    sag = 2e-5 + 20 / 1e6
    bounds = found["error"]["frozen"]["translation"]
    far = np.hypot(3e-5, sag)
    assert bounds["lower"] <= far * (1 + 1e-9)
    assert bounds["upper"] >= far * (1 - 1e-9)
    assert bounds["upper"] - bounds["lower"] <= 1e-6
    _, out, _ = run(*words, "--gravity", "z=-10", "--json", "-")
    # the mass of frame "post" is attached before its spring
    sag = 2e-5 + (20 + 3.0 * 10) / 1e6
    screw = json.loads(out)["platform_screw"]
    assert screw[5] == pytest.approx(-sag, rel=1e-9)
    status, out, err = run(*words, "--assumption", "budget")
    assert (status, out) == (2, "")
    assert "assumption budget: found a load, expected none" in err


HINGE = """
platform = "tip"
[[frame]]
name = "hinge"
parent = "base"
joint = "revolute"
joint_stiffness = [1e6, 1e6, 100, 1e6, 1e6, 1e6]
clearance = { radial = 3e-5, axial = 2e-5 }
[[frame]]
name = "tip"
parent = "hinge"
"""


def test_each_assumption_has_a_separate_result(run, tmp_path):
    """The rotation under a moment is M / k of the hinge; the clearance is added."""
    file = tmp_path / "hinge.toml"
    file.write_text(HINGE)
    status, out, _ = run("assembly", "error", file, "--load", "mz=0.1")
    assert status == 0
    turn, shift, free = (line.strip() for line in out.splitlines()[2:])
    assert turn.split() == "frozen, rotation 1 to 1 mrad".split()
    assert shift.split() == "frozen, translation 0.0360555 to 0.0360555 mm".split()
    assert " ".join(free.split()).startswith("free no answer: the load drives a motion")
    _, out, _ = run("assembly", "error", file, "--load", "mz=0.1", "--json", "-")
    assert json.loads(out)["error"]["free"]["rotation"] is None
    _, out, _ = run("assembly", "error", file, "--assumption", "free")
    said = " ".join(out.split())
    assert "free, rotation without bound free, translation 0.0360555 to" in said


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["solve", "--load", "fx=1e300"],
         "--load fx: found 1e+300, expected a number of magnitude at most 1e+40"),
        (["solve", "--gravity", "z=1e300"],
         "--gravity z: found 1e+300, expected a number of magnitude at most 1e+06"),
        (["solve", "--pose", "tx=1e300"], "--pose tx: found 1e+300"),
        (["solve", "--joint", "left.drive=1e300"], "--joint left.drive: found 1e+300"),
        (["solve", "--under", "temperature=1e300"], "--under temperature: found"),
        (["error", "--energy-budget", "1e300"], "--energy-budget: found 1e+300"),
        (["error", "--at", "tx=1"], '--at: unknown component "tx"; valid: x, y, z'),
        (["error", "--along", "mx=1"], '--along: unknown component "mx"'),
        (["error", "--along", "tx=0"], "translation or rotation components (not both)"),
        (["error", "--along", "tx=1,rz=1"], "expected either translation or rotation"),
        (["solve", "--rest", "ankle"], '--rest: no frame "ankle"'),
        (["solve", "--mismatch", "glue"], '--mismatch: found "glue"'),
    ],
)  # fmt: skip
def test_message_about_an_invalid_value_names_the_option(run, words, message):
    status, out, err = run("assembly", words[0], "five_bar", *words[1:])
    assert (status, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1


def test_functions_reject_infinite_or_huge_numbers():
    posture = home_posture(load_robot("five_bar"))
    with pytest.raises(BadInput, match=r"load: found 1e\+300, expected finite numbers"):
        solve_assembly(posture, [0, 0, 0, 1e300, 0, 0])
    with pytest.raises(BadInput, match="gravity: found nan"):
        solve_assembly(posture, gravity=[0, 0, np.nan])
    errors = np.zeros((len(posture.robot.frames), 6))
    errors[2, 3] = 1e300
    robot = posture.robot.with_errors(errors)
    with pytest.raises(BadInput, match=r"geometric_error: found 1e\+300"):
        solve_assembly(replace(posture, robot=robot))
    with pytest.raises(ValueError, match="an error is larger than"):
        solve_assembly([replace(posture, robot=robot)], errors=errors[None])
    assert solve_assembly(posture, [0, 0, 0, 1e40, 0, 0]).energy > 1e60


SOURCES = """
[[errors]]
frames = ["slide"]
most = [5e-4, 5e-4, 5e-4, 5e-5, 5e-5, 5e-5]
"""


@pytest.mark.parametrize(
    "words",
    [("statistics", "--errors", "errors.toml", "--draws", "20"),
     ("tolerances", "--grid", "tx=0,ty=0,tz=0.45"), ("error",),
     ("solve", "--quantities", "margin"),
     ("sweep", "--grid", "tx=0,ty=0,tz=0.45", "-o", "x.nc")],
)  # fmt: skip
def test_commands_report_inconclusive_analysis_at_singularity(
    run, tmp_path, monkeypatch, words
):
    monkeypatch.chdir(tmp_path)
    write_robot(three_upu(seed=1), tmp_path / "snu.toml")
    (tmp_path / "errors.toml").write_text(SOURCES)
    command, *options = words
    status, out, _ = run("assembly", command, "snu.toml", *options)
    assert status == 1
    assert "the first-order analysis is inconclusive" in out


def with_a_limit(path):
    """Write an Orthoglide whose first slide has the limits -0.4 and -0.3 m."""
    robot = load_robot("orthoglide")
    frames = tuple(
        replace(f, limits=(-0.4, -0.3)) if f.name == "x.slide" else f
        for f in robot.frames
    )
    write_robot(replace(robot, frames=frames), path)


@pytest.mark.parametrize(
    "words",
    [("solve", "--quantities", "margin"), ("error", "--tolerance-translation", "1e-5"),
     ("solve", "--state", "exact"),
     ("stiffness",), ("deflection", "--along", "fz=0:-10:10"),
     ("solve", "--load", "fz=-10")],
)  # fmt: skip
def test_commands_report_postures_beyond_joint_limits(
    run, tmp_path, monkeypatch, words
):
    monkeypatch.chdir(tmp_path)
    with_a_limit(tmp_path / "r.toml")
    command, *options = words
    pose = ["--pose", "tx=0.05,ty=0,tz=0"]
    status, out, err = run("assembly", command, "r.toml", *pose, *options)
    said = "beyond the limits of its joints: x.slide at -0.26 m, limits -0.4 to -0.3"
    assert status == 0
    assert (out + err).count(said) == 1


def test_statistics_beyond_joint_limits_has_exit_status_1(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with_a_limit(tmp_path / "r.toml")
    (tmp_path / "errors.toml").write_text(SOURCES)
    words = ["--errors", "errors.toml", "--draws", "20", "--pose", "tx=0.05,ty=0,tz=0"]
    status, out, _ = run("assembly", "statistics", "r.toml", *words)
    assert (status, out) == (
        1, "beyond_limits: x.slide at -0.26 m, limits -0.4 to -0.3\n"
    )  # fmt: skip
