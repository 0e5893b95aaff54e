"""The command ``forcefit assembly path``."""

import json
from pathlib import Path

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.model.robot import BeamLink, Frame, Robot
from forcefit.assembly.path.path_file import PathTable
from forcefit.assembly.path.request import errors_along_path
from forcefit.assembly.sweeps.dataset import open_dataset

EXAMPLE = Path(__file__).parents[3] / "examples" / "hexapod_path.csv"
PEAK = 10 / np.sqrt(3)  # largest acceleration of a quintic profile [D / T^2]


@pytest.fixture
def slide(tmp_path):
    """Write a slide along x with a 3 kg tool on a transverse bar, and a path."""
    rail = Frame("rail", joint="prismatic", rotation=[0, np.pi / 2, 0], actuated=True)
    link = BeamLink({"radius": 0.01}, 70e9, 0.3, theory="euler")
    tool = Frame("tool", "rail", [0, 0.2, 0], mass=3.0, link=link)
    write_robot(Robot("slide", "tool", (rail, tool)), tmp_path / "slide.toml")
    (tmp_path / "way.csv").write_text("q.rail\n0\n0.1\n")
    return tmp_path


def test_path_error_equals_cantilever_deflection(run, slide):
    """The deflection is F L^3 / (3 E I), with F = m a and a = 10 / sqrt(3) D / T^2."""
    status, out, _ = run(
        "assembly", "path", slide / "slide.toml", "--path", slide / "way.csv",
        "--profile", "quintic", "--duration", 0.05, "--points", 2001, "--json", "-",
    )  # fmt: skip
    answer = json.loads(out)
    force = 3.0 * PEAK * 0.1 / 0.05**2
    bending = force * 0.2**3 / (3 * 70e9 * np.pi * 0.01**4 / 4)
    frequency = np.sqrt(force / bending / 3.0) / (2 * np.pi)
    assert status == 0
    largest = answer["largest"]
    assert largest["inertial_translation"]["value"] == pytest.approx(bending, rel=1e-5)
    assert largest["force"]["value"] == pytest.approx(force, rel=1e-5)
    assert largest["force"]["frame"] in {"rail", "tool"}
    stress = 4 * force * 0.2 / (np.pi * 0.01**3)
    assert largest["stress"]["value"] == pytest.approx(stress, rel=1e-3)
    assert answer["drives"]["rail"]["value"] == pytest.approx(force, rel=1e-5)
    assert largest["speed"]["value"] == pytest.approx(1.875 * 0.1 / 0.05, rel=1e-6)
    assert answer["first_frequency"] == pytest.approx(frequency, rel=1e-6)
    assert answer["periods"] == pytest.approx(0.05 * frequency, rel=1e-6)
    assert "less than 10" in answer["remarks"][0]


def test_path_writes_data_figure_and_page(run, tmp_path):
    files = {name: tmp_path / f"path.{name}" for name in ("nc", "png", "html", "json")}
    status, _, _ = run(
        "assembly", "path", "hexapod", "--path", EXAMPLE, "--gravity", "z=-9.81",
        "--points", 41, "--assumption", "frozen", "-o", files["nc"],
        "--figure", files["png"], "--report", files["html"], "--json", files["json"],
    )  # fmt: skip
    assert status == 0
    data = open_dataset(files["nc"])
    answer = json.loads(files["json"].read_text())
    assert data.sizes["time"] == 41
    assert data.attrs["path_law"] == "times"
    assert data["drive_force"].sizes == {"time": 41, "drive": 6}
    shift = data["inertial_screw"].sel(screw=["TX", "TY", "TZ"])
    assert float(np.sqrt((shift**2).sum("screw")).max()) == pytest.approx(
        answer["largest"]["inertial_translation"]["value"]
    )
    bounds = data["translation_error"]
    assert (bounds.sel(bound="lower") <= bounds.sel(bound="upper")).all()
    assert answer["largest"]["translation_bound"]["value"] == pytest.approx(
        float(bounds.sel(bound="upper").max())
    )
    page = files["html"].read_text()
    assert "errors along a path" in page
    assert "Quasi-static" in page
    assert files["png"].read_bytes().startswith(b"\x89PNG")


def test_path_beyond_a_joint_limit_has_results_before_the_limit(run, slide):
    """The joint limit of 50 mm is reached after half of the path."""
    file = slide / "slide.toml"
    text = file.read_text().replace(
        "actuated = true", "actuated = true\nlimits = [0, 0.05]"
    )
    file.write_text(text)
    status, out, _ = run(
        "assembly", "path", file, "--path", slide / "way.csv", "--profile", "quintic",
        "--duration", 0.5, "--json", slide / "new.json", "-o", slide / "new.nc",
        "--report", slide / "new.html",
    )  # fmt: skip
    answer = json.loads((slide / "new.json").read_text())
    assert status == 1
    assert answer["status"] == "beyond_limits"
    assert answer["reason"].startswith("at 0.2525 s: rail at 0.05")
    assert "beyond_limits" in out
    assert (answer["points"], answer["solved"]) == (201, 101)
    largest = answer["largest"]
    assert largest["speed"]["value"] == pytest.approx(1.875 * 0.1 / 0.5)
    force = 3.0 * PEAK * 0.1 / 0.5**2
    assert answer["drives"]["rail"]["value"] == pytest.approx(force, rel=1e-3)
    data = open_dataset(slide / "new.nc")
    assert np.isnan(data["drive_force"].values[101:]).all()
    assert np.isfinite(data["drive_force"].values[:101]).all()


def test_interval_option_sets_the_time_between_rows(run, slide):
    status, out, _ = run(
        "assembly", "path", slide / "slide.toml", "--path", slide / "way.csv",
        "--interval", 0.25, "--json", "-",
    )  # fmt: skip
    answer = json.loads(out)
    assert status == 0
    assert answer["duration"] == pytest.approx(0.25)
    assert answer["largest"]["acceleration"]["value"] == pytest.approx(
        PEAK * 0.1 / 0.25**2, rel=1e-3
    )


def test_errors_along_path_equals_command_result(run, slide):
    table = PathTable(("q.rail",), np.array([[0.0], [0.1]]))
    found = errors_along_path(
        slide / "slide.toml", table, profile="quintic", duration=0.05, points=51
    )
    _, out, _ = run(
        "assembly", "path", slide / "slide.toml", "--path", slide / "way.csv",
        "--profile", "quintic", "--duration", 0.05, "--points", 51, "--json", "-",
    )  # fmt: skip
    force = json.loads(out)["drives"]["rail"]["value"]
    assert np.abs(found.arrays["drive_force"]).max() == force
    assert "at most" in repr(found)


BAD = {
    "no times": ([], "found no times; expected one of a column time, --interval and "),
    "unknown profile": (["--profile", "quintik", "--duration", "1"],
                        'found "quintik"; did you mean "quintic"?'),
    "no duration": (["--profile", "quintic"], "--profile: expected --duration"),
    "limit alone": (["--interval", "1", "--speed", "1"], "--speed: found no --profile"),
    "negative": (["--profile", "quintic", "--duration", "-1"], "--duration: found -1"),
    "infinite": (["--profile", "quintic", "--speed", "inf"], "--speed: found inf"),
    "twice": (["--profile", "quintic", "--duration", "1", "--interval", "1"],
              "found --interval and --profile"),
    "ends": (["--interval", "1", "--ends", "reset"], '--ends: found "reset"; did you'),
    "moving": (["--profile", "quintic", "--duration", "1", "--ends", "moving"],
               "--ends moving: found --profile"),
    "points": (["--interval", "1", "--points", "1"], "--points: found 1, expected 2"),
    "assumption": (["--interval", "1", "--assumption", "budget"],
                   '--assumption: found "budget"'),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_invalid_path_option_has_a_one_line_message(run, slide, name):
    words, message = BAD[name]
    output = slide / "out.nc"
    status, out, err = run(
        "assembly", "path", slide / "slide.toml", "--path", slide / "way.csv", *words,
        "-o", output,
    )  # fmt: skip
    assert (status, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1
    assert not output.exists()


def test_message_names_the_path_row_out_of_reach(run, tmp_path):
    file = tmp_path / "far.csv"
    file.write_text("id,time,pose.tx,pose.ty\na,0,0,0.14\nb,1,0.01,0.9\n")
    status, out, err = run("assembly", "path", "five_bar", "--path", file)
    assert (status, out) == (2, "")
    assert 'far.csv: row "b": pose tx=0.01, ty=0.9 cannot be reached' in err
    assert err.count("\n") == 1


def test_path_with_unreachable_points_between_rows_is_rejected(run, tmp_path):
    """Both rows can be reached, but the straight line between them cannot."""
    file = tmp_path / "through.csv"
    file.write_text("pose.tx,pose.ty\n-0.16,0.06\n0.16,0.06\n")
    words = ["--profile", "quintic", "--duration", "1"]
    status, out, err = run("assembly", "path", "five_bar", "--path", file, *words)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1


def test_path_rejects_unknown_drive_or_state(run, slide):
    asked = ["assembly", "path", slide / "slide.toml", "--path", slide / "way.csv",
             "--profile", "quintic", "--duration", 0.05]  # fmt: skip
    status, _, message = run(*asked, "--drive-force", "rial=3")
    assert status == 2
    assert 'no drive "rial"; did you mean "rail"' in message
    status, _, message = run(*asked, "--state", "contcat", "-o", slide / "way.nc")
    assert status == 2
    assert "--state: found 'contcat'; did you mean" in message
    assert not list(slide.glob("way.nc*"))


def test_path_reports_unconstrained_pose_components(run, tmp_path):
    """A table with two columns constrains two of six degrees of freedom."""
    rows = "pose.tx,pose.tz\n0,0.53\n0.01,0.53\n"
    (tmp_path / "way.csv").write_text(rows)
    status, out, _ = run(
        "assembly", "path", "hexapod", "--path", tmp_path / "way.csv",
        "--profile", "quintic", "--duration", 0.5, "--points", 5,
    )  # fmt: skip
    assert status == 0
    assert (
        "the path contains only tx, tz, but the platform has 6 degrees of freedom"
        in out
    )


def test_path_applies_effects(run, slide):
    """A 0.2 m bar with an expansion of 2e-5 1/K elongates by 20 um at 5 K."""
    robot = slide / "slide.toml"
    effect = '[[effect]]\nname = "thermal_expansion"\nparameters = { tool = 2e-5 }\n'
    robot.write_text(robot.read_text() + "\n" + effect)
    arguments = ["assembly", "path", robot, "--path", slide / "way.csv", "--profile",
                 "quintic", "--duration", 1e3, "--points", 3]  # fmt: skip
    status, _, _ = run(*arguments, "--under", "temperature=5", "-o", slide / "warm.nc")
    assert status == 0
    with open_dataset(slide / "warm.nc") as data:
        assert data.platform_screw.values[:, 4] == pytest.approx(2e-5, rel=1e-9)
    status, _, err = run(*arguments)
    assert status == 2
    assert 'effect "thermal_expansion" depends on temperature' in err
