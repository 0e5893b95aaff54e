"""Results of commands, and messages for invalid input."""

import json
import os
import re
import subprocess
import sys
import warnings
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
import typer

import forcefit
from forcefit.assembly.files.robot_file import write_robot
from forcefit.commands import app as command
from tests.pages_for_tests import parse
from tests.robots_for_tests import NUMBERS, coaxial_beams, irsbot2_with

ROOT = Path(__file__).parents[3]


@pytest.fixture
def robot_file(tmp_path):
    path = tmp_path / "robot.toml"
    write_robot(irsbot2_with(NUMBERS["cases"][0]), path)
    return path


def test_solve_writes_json_with_the_public_keys(run, robot_file):
    status, out, _ = run("assembly", "solve", robot_file, "--pose", "tx=0,tz=-0.5",
                         "--json", "-")  # fmt: skip
    found = json.loads(out)
    assert status == 0
    point = NUMBERS["cases"][0]["points"][0]
    assert found["energy"] == pytest.approx(point["energy"], rel=1e-10)
    assert set(found["zone"]) >= {"assemblable", "margin", "margin_free"}
    assert found["zone"]["assemblable"] is False
    assert set(found["certificate"]) >= {
        "closure_residual", "clearance_excess", "duality_gap", "relative_gap",
    }  # fmt: skip
    frame = found["frames"]["leg1.link_a"]
    assert {k: len(v) for k, v in frame.items()} == dict.fromkeys(
        ("clearance", "link", "joint", "wrench", "joint_wrench"), 6
    )
    assert found["closures"][-1]["frames"] == ["leg1.tip", "leg2.tip"]
    assert len(found["closures"][-1]["wrench"]) == 6


def test_pose_and_joint_options_have_equal_results(run, robot_file):
    _, out, _ = run("assembly", "solve", robot_file, "--pose", "tx=0.1",
                    "--pose", "tz=-0.45", "--json", "-")  # fmt: skip
    by_pose = json.loads(out)
    drives = [f"{n}={by_pose['joints'][n]!r}" for n in ("leg1.drive", "leg2.drive")]
    _, out, _ = run("assembly", "solve", robot_file, "--joint", ",".join(drives),
                    "--json", "-")  # fmt: skip
    by_joints = json.loads(out)
    assert by_joints["energy"] == pytest.approx(by_pose["energy"], rel=1e-9)
    assert by_joints["pose"]["tx"] == pytest.approx(0.1, abs=1e-10)


def test_robot_that_cannot_assemble_has_exit_status_1(run, tmp_path):
    path = tmp_path / "stuck.toml"
    path.write_text(
        'platform = "a"\n[[frame]]\nname = "a"\nparent = "base"\n[[frame]]\n'
        'name = "b"\nparent = "base"\ngeometric_error = [0, 0, 0, 1e-3, 0, 0]\n'
        '[[closure]]\nframes = ["a", "b"]\n'
    )
    status, out, _ = run("assembly", "solve", path, "--json", "-")
    found = json.loads(out)
    assert status == 1
    assert found["status"] == "cannot assemble"
    assert found["energy"] is None
    assert found["zone"]["margin"] is None
    assert found["zone"]["assemblable"] is False


def test_error_command_writes_the_public_keys(run, robot_file, tmp_path):
    status, out, _ = run("assembly", "error", robot_file, "--pose", "tx=0,tz=-0.5",
                         "--json", tmp_path / "e.json")  # fmt: skip
    found = json.loads((tmp_path / "e.json").read_text())["error"]
    assert status == 0
    assert "frozen" in out
    assert set(found) == {"frozen", "free", "budget"}
    point = NUMBERS["cases"][0]["points"][0]
    for name, key in (("rotation", "full_rigid_R"), ("translation", "full_rigid_T")):
        bracket = found["frozen"][name]
        assert bracket["lower"] <= point[key][1] + 1e-9
        assert bracket["upper"] >= point[key][0] - 1e-9
        assert len(bracket["platform_screw"]) == 6
    assert found["budget"]["rotation"]["lower"] >= found["frozen"]["rotation"]["lower"]


COLUMN = """name = "column"
platform = "tip"
[[frame]]
name = "tip"
parent = "base"
translation = [1.0, 0.0, 0.0]
link = { beam = { radius = 0.005 }, young = 7e10, poisson = 0.3, pieces = 4 }
"""


def test_exact_solution_reports_a_state_beyond_a_critical_load(run, tmp_path):
    """The Euler load is 84.8 N, or 82.7 N for a column of 4 segments.

    Above this load, the straight state is unstable, and the bent state is stable.
    """
    column = tmp_path / "column.toml"
    column.write_text(COLUMN)
    for load, status, said in (
        ("fx=-80", 0, ""),
        ("fx=-90", 1, "the potential energy decreases along"),
        ("fx=-90,fy=0.1", 0, "%; this may be beyond a critical load"),
        ("fx=-20,fy=0.1", 0, ""),
    ):
        found, out, _ = run(
            "assembly", "solve", column, "--state", "exact", "--load", load
        )
        assert said in out
        assert ("critical load" in out) == bool(said)
        assert found == status


def test_show_writes_a_figure(run, robot_file, tmp_path):
    status, _, _ = run(
        "assembly", "show", robot_file, "--figure", tmp_path / "robot.png"
    )
    assert status == 0
    assert (tmp_path / "robot.png").read_bytes().startswith(b"\x89PNG")


def test_scene_of_a_bar_shows_the_tip_deflection(run, write_file, tmp_path):
    """The tip deflection is F L^3 / (3 E I) + F L / (k G A).

    The shear coefficient k of a round bar is taken from Cowper (1966).
    """
    bar = write_file("""
name = "bar"
platform = "tip"
[[frame]]
name = "tip"
parent = "base"
translation = [0.4, 0, 0]
link = { beam = { radius = 0.01 }, young = 2e11, poisson = 0.3 }
""")
    page = tmp_path / "bar.html"
    status, _, err = run("assembly", "show", bar, "--load", "fz=-50", "--figure", page)
    assert status == 0, err
    (spec,) = parse(page.read_text("utf-8")).figures
    bending = 0.4**3 / (3 * 2e11 * np.pi * 0.01**4 / 4)
    shear = 0.4 / (6 * 1.3 / 8.8 * 2e11 / 2.6 * np.pi * 0.01**2)
    expected = -50.0 * (bending + shear)
    (tip,) = (body for body in spec["bodies"] if body["name"] == "tip")
    np.testing.assert_allclose(tip["moved"][-1], [0, 0, expected], atol=1e-12)


def test_show_rejects_exaggeration_for_html_figures(run, tmp_path):
    page = tmp_path / "robot.html"
    words = ["hexapod", "--exaggeration", 5, "--figure", page]
    status, _, err = run("assembly", "show", *words)
    assert (status, page.exists()) == (2, False)
    assert "--exaggeration: found together with an HTML figure" in err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["assembly", "solve", "irsbot3"], '"irsbot3": neither a built-in robot nor a'),
        (["assembly", "solve", "no.toml"], "no.toml: cannot be read: No such file"),
        (["assembly", "solve", "irsbot2", "--pose", "tx"], '--pose: found "tx"'),
        (["assembly", "solve", "irsbot2", "--pose", "tz=-9"], "cannot be reached"),
        (["assembly", "solve", "irsbot2", "--pose", "tx=0", "--joint", "leg1.drive=0"],
         "found both a pose and joints"),
        (["assembly", "solve", "irsbot2", "--joint", "leg1.elbow=1"],
         'no actuated joint "leg1.elbow"'),
        (["assembly", "solve", "irsbot2", "--load", "f=1"], '--load: unknown'),
        (["assembly", "solve", "irsbot2", "--json", "/nowhere/x.json"],
         "/nowhere/x.json: "),
        (["assembly", "error", "irsbot2", "--assumption", "fre"],
         '--assumption: found'),
        (["assembly", "error", "irsbot2", "--tolerance-rotation", "-1"],
         "--tolerance-rotation: found -1.0, expected a finite number > 0"),
        (["assembly", "sweep", "irsbot2", "--grid", "tx=0:1:0", "-o", "x.nc"],
         "grid tx: found a step of 0"),
        (["assembly", "solve", "irsbot2", "--poze", "tx=0"],
         "--pose"),
        (["assembly", "solve", "irsbot2", "--po\nze"], r"--po\x0aze"),
        (["assembly", "solve"], "Missing argument 'ROBOT'"),
        (["asembly"], "'assembly'"),
        (["assembly", "solve", "irsbot2", "more"], "unexpected extra argument"),
        (["assembly", "sweep", "irsbot2", "--grid", "tx=0"], "Missing option '-o'"),
        (["assembly", "error", "irsbot2", "--energy-budget", "x"],
         "Invalid value for '--energy-budget': "),
        (["assembly", "stiffness", "delta", "--along", "tx=0"],
         "--along: expected either translation or rotation"),
        (["assembly", "stiffness", "delta", "--along", "tx=nan"],
         "--along tx: found nan"),
        (["assembly", "stiffness", "delta", "--at", "1,2"],
         "--at: found '1,2', expected three numbers"),
        (["assembly", "stiffness", "delta", "--length", "0"],
         "--length: found 0, expected a finite number > 0"),
        (["assembly", "stiffness", "delta", "--load", "fz=nan"],
         "--load fz: found nan, expected a finite number"),
        (["assembly", "deflection", "four_bar", "--along", "fz"],
         "--along: found 'fz', expected COMPONENT=FROM:TO:STEP"),
        (["assembly", "deflection", "four_bar", "--along", "fq=0:1:1"],
         '--along: unknown component "fq"'),
        (["assembly", "deflection", "four_bar", "--along", "fz=0:1:0"],
         "expected two different loads and a nonzero step"),
        (["assembly", "deflection", "four_bar", "--along", "fz=0:inf:1"],
         "expected finite numbers"),
        (["assembly", "deflection", "four_bar", "--along", "fz=0:1e9:1"],
         "expected at most 10000"),
        (["assembly", "deflection", "four_bar", "--along", "fx=0:1:1", "--follow",
          "--back"], "--follow: found together with --back"),
        (["assembly", "frequencies", "irsbot2"],
         'irsbot2: found no moving mass; expected "density"'),
        (["example", "irsbot"], 'example: found "irsbot"; did you mean "irsbot2"?'),
        (["example", "irsbot2", "-o", "nowhere"], "nowhere: folder not found"),
        (["new", "mine"],
         "--kind: missing, expected UPS | RUS | UPU | PRS | RRR | delta"),
        (["new", "mine", "--kind", "UPX"], '--kind: found "UPX"; did you mean "UPU"?'),
        (["new", "mine", "--kind", "UPS", "--legs", "7"],
         "--legs: found 7, expected a multiple of 2 from 6 to 12 for --kind UPS"),
        (["new", "a b", "--kind", "RRR"], 'NAME: found "a b", expected letters'),
        (["new", "absent/mine", "--kind", "RRR"], "found no folder"),
        (["study", "no.toml"], "no.toml: cannot be read: No such file or directory"),
        (["validation", "crosscheck", "irsbot2", "--scale", "1"], "--scale: found"),
    ],
)  # fmt: skip
def test_invalid_input_has_one_message_and_exit_status_2(
    run, tmp_path, monkeypatch, words, message
):
    monkeypatch.chdir(tmp_path)
    status, out, err = run(*words)
    assert status == 2
    assert out == ""
    assert message in err
    assert err.startswith("forcefit: ")
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def commands(command, words=()):
    """Yield the words and the object of each command and command group."""
    yield words, command
    for name, inner in getattr(command, "commands", {}).items():
        yield from commands(inner, (*words, name))


EVERY_COMMAND = dict(commands(typer.main.get_command(command.app)))


@pytest.mark.parametrize("words", EVERY_COMMAND, ids=" ".join)
def test_every_command_prints_its_help(run, words):
    status, out, err = run(*words, "--help")
    assert (status, err) == (0, "")
    assert out.startswith(" ".join(("Usage: forcefit", *words)))
    assert run(*words, "-h") == (status, out, err)


GROUPS = [w for w, own in EVERY_COMMAND.items() if hasattr(own, "commands")]


@pytest.mark.parametrize("group", GROUPS, ids=" ".join)
def test_group_without_a_command_prints_its_help(run, group):
    status, out, err = run(*group)
    _, expected, _ = run(*group, "--help")
    assert (status, out) == (2, "")
    assert err.strip() == expected.strip()
    assert len(err.splitlines()) > 5


@pytest.mark.parametrize("words", EVERY_COMMAND, ids=" ".join)
def test_help_prints_units_in_brackets(run, words):
    """Brackets are not interpreted as markup, and command lists are not truncated."""
    _, out, _ = run(*words, "--help")
    printed = " ".join(out.split())
    command = EVERY_COMMAND[words]
    for text in [command.help or "", *(p.help or "" for p in command.params)]:
        for part in re.findall(r"\[[^]]*\]", text):
            assert " ".join(part.split()) in printed
    assert "..." not in out.partition("Commands:")[2]


def test_version_option_prints_the_package_version(run):
    installed = version("forcefit")
    assert run("--version") == (0, f"forcefit {installed}\n", "")
    assert forcefit.__version__ == installed
    with pytest.raises(AttributeError, match="no attribute 'version'"):
        forcefit.version  # noqa: B018


@pytest.mark.parametrize(
    ("typed", "offered"),
    [("forcefit asse", "assembly"), ("forcefit assembly so", "solve"),
     ("forcefit validation crosscheck --with", "--with-clearance"),
     ("forcefit assembly solve arm", "arm6")],
)  # fmt: skip
def test_shell_completion_offers_commands_options_and_robots(typed, offered):
    asked = {"_FORCEFIT_COMPLETE": "complete_bash", "COMP_WORDS": typed,
             "COMP_CWORD": str(len(typed.split()) - 1)}  # fmt: skip
    done = subprocess.run([sys.executable, "-m", "forcefit"], env=os.environ | asked,
                          capture_output=True, text=True, check=True)  # fmt: skip
    assert done.stdout.split() == [offered]


def test_characters_outside_the_encoding_are_escaped(tmp_path):
    """On Windows, files and pipes have such an encoding."""
    robot = replace(coaxial_beams([0, 0, 0, 1e-4, 0, 0]), name="Ω-4")
    write_robot(robot, tmp_path / "omega.toml")
    words = [sys.executable, "-m", "forcefit", "assembly", "solve", "omega.toml"]
    paths = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    env = os.environ | {"PYTHONIOENCODING": "cp1252", "PYTHONPATH": paths}
    done = subprocess.run(words, cwd=tmp_path, env=env, capture_output=True,
                          check=False)  # fmt: skip
    assert done.stderr == b""
    assert b"\\u03a9-4" in done.stdout


def test_unknown_robot_has_no_traceback():
    done = subprocess.run([sys.executable, "-m", "forcefit", "assembly", "solve", "x"],
                          capture_output=True, text=True, check=False)  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.startswith('forcefit: "x": neither a built-in robot nor a file')
    assert done.stdout == ""


@pytest.mark.parametrize(
    "words",
    [
        ["validation", "diagnose", "campaign", "--calibrate", "1" * 9],
        ["assembly", "statistics", "bar.toml", "-o", "x.nc", "--workers", "9" * 40],
        ["assembly", "statistics", "bar.toml", "-o", "x.nc", "--importance", "1" * 9],
        ["stiffness", "library", "spec.toml", "--workers", "1025"],
    ],
)  # fmt: skip
def test_huge_counts_are_rejected(run, tmp_path, monkeypatch, words):
    """Starting a million processes would take minutes."""
    monkeypatch.chdir(tmp_path)
    status, _, err = run(*words)
    assert status == 2
    assert f"'{words[-2]}'" in err
    assert words[-1] in err
    assert list(tmp_path.iterdir()) == []


def test_library_warnings_are_shown_only_on_request(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["forcefit", "--version"])
    with warnings.catch_warnings():
        monkeypatch.setattr(sys, "warnoptions", ["default"])
        with pytest.raises(SystemExit):
            command.main()
        with pytest.raises(UserWarning):  # pytest turns warnings into errors
            warnings.warn("a library's", stacklevel=1)
        monkeypatch.setattr(sys, "warnoptions", [])
        with pytest.raises(SystemExit):
            command.main()
        warnings.warn("a library's", stacklevel=1)
