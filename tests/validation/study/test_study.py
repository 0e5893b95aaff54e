"""Tests of study files, the output of studies, and messages about invalid files."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray

import forcefit as ff
from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.linear.reference import as_printed
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.assembly.report.pose_errors import pose_error_of
from forcefit.assembly.robots import BUILT_IN
from forcefit.inputs.table import BadInput
from forcefit.validation.study.headline import verdict, worst_clearance
from forcefit.validation.study.report import report_page, results_table, write_study
from forcefit.validation.study.study import run_study
from forcefit.validation.study.study_file import read_study
from tests.pages_for_tests import parse
from tests.robots_for_tests import NUMBERS, coaxial_beams, irsbot2_with

EXAMPLE = Path(__file__).parents[3] / "examples" / "irsbot2.toml"
SMALL = """
robot = "irsbot2"
title = "small <study>"
grid = "tx=-0.1:0.1:0.1,tz=-0.5:-0.4:0.1"
[errors]
frames = ["elbow_a", "link_a", "elbow_b", "link_b", "loop2_platform", "tip"]
least = [1e-4, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6]
most = [2e-2, 2e-2, 2e-2, 2e-4, 2e-4, 2e-4]
seed = 1
[pose]
tx = 0.0
tz = -0.5
"""


def study_file(tmp_path, text):
    path = tmp_path / "study.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    steps = []
    results = ff.run_study(
        study_file(folder, SMALL), lambda *step: steps.append(step),
        output=folder / "out",
    )  # fmt: skip
    return results, folder / "out", steps


@pytest.mark.exudyn
def test_study_agrees_with_the_reference_numbers(results):
    outcome, _, steps = results
    point = NUMBERS["cases"][0]["points"][0]
    assert outcome.solution["energy"] == pytest.approx(point["energy"], rel=1e-10)
    zone = outcome.solution["zone"]
    assert zone["margin_free"] == pytest.approx(point["t_compliant_free"], rel=1e-9)
    assert outcome.reference["relative_difference"]["energy"] < 1e-8
    assert outcome.crosscheck.slope == pytest.approx(2.0, abs=0.1)
    assert outcome.passed
    assert ("maps", 6, 6) in steps
    lines = verdict(outcome).splitlines()
    assert lines[0].startswith("It assembles only by force: ")
    assert lines[0].endswith(" 1.926 J.")
    assert lines[1].startswith("Its clearances must be 2.39 times as large")


@pytest.mark.exudyn
def test_study_folder_has_a_self_contained_report_and_results(results):
    outcome, folder, _ = results
    names = {p.name for p in folder.iterdir()}
    assert names == {"report.html", "results.json", "results.nc"}
    page = (folder / "report.html").read_text()
    assert "small &lt;study&gt;" in page
    seen = parse(page)
    assert seen.fetched == []
    assert len(page) < 5_000_000
    table = json.loads((folder / "results.json").read_text())
    assert seen.results == table
    assert table["passed"] is True
    assert table["solution"]["energy"] == outcome.solution["energy"]
    assert np.array(table["solution"]["platform_screw"]).shape == (6,)
    assert table["maps"]["status"] == {"ok": 6}
    with xarray.open_dataset(folder / "results.nc") as data:
        assert data.energy.shape == (3, 2)
        (drawn,) = (one for one in seen.figures if "layers" in one)
        for layer in drawn["layers"]:
            values = data[layer["key"]]
            values = values.sel(bound="upper") if "bound" in values.dims else values
            held = np.array(layer["values"], dtype=float)
            np.testing.assert_array_equal(held, values.values)


@pytest.mark.exudyn
def test_study_page_shows_the_results(results):
    outcome, folder, _ = results
    seen = parse((folder / "report.html").read_text())
    table = json.loads((folder / "results.json").read_text())
    worst = table["worst_clearance"]["pose"]
    tile = [number.value for number in seen.numbers[:2]]
    assert tile == [worst["rotation"], worst["translation"]]
    assert seen.numbers[1].text == "0.794 mm"  # 0.7943345850 mm in the README
    rows = seen.table("part", "made perfect")[1:]
    assert len(rows) == len(table["governing"]) == 12 + 8  # errors, clearances
    for row, one in zip(rows, table["governing"], strict=True):
        assert (row[0].text, row[1].text) == (one["part"], one["what"])
        assert [row[2].value, row[4].value] == [one["rotation"], one["translation"]]
    solution = {
        row[0].text: row[1].value for row in seen.table("quantity", "value")[1:]
    }
    assert solution["energy, eq. (22)"] == table["solution"]["energy"]
    for name, *wrench in seen.table("link")[1:]:
        expected = table["solution"]["frames"][name.text]["wrench"]
        # Round-off is shown as 0.
        shown = [cell.value for cell in wrench]
        assert shown == pytest.approx(expected, rel=0.0, abs=1e-5)
    (scene,) = (one for one in seen.figures if "bodies" in one)
    frames = [one["name"] for one in scene["bodies"]]
    platform = outcome.assembly.posture.platform[:3, 3]
    tip = scene["bodies"][frames.index(outcome.robot.platform)]
    np.testing.assert_allclose(tip["nominal"][-1], platform, atol=1e-12)
    shift = table["solution"]["platform_screw"][3:]
    np.testing.assert_allclose(tip["moved"][-1], shift, atol=1e-9)
    assert len(scene["closing"]) >= 6
    arrows = {frames[arrow["body"]]: arrow["force"] for arrow in scene["forces"]}
    for name, force in arrows.items():
        size = np.linalg.norm(table["solution"]["frames"][name]["wrench"][3:])
        assert np.linalg.norm(force) == pytest.approx(size)


def test_energy_of_explicit_errors_equals_hand_calculation(tmp_path):
    write_robot(coaxial_beams(np.zeros(6)), tmp_path / "beams.toml")
    text = (
        'robot = "beams.toml"\n[errors.explicit]\ntwo = [0, 0, 0, 2e-4, 0, 0]\n'
        "[checks]\ncrosscheck = false\npicture = false\n"
    )
    results = run_study(read_study(study_file(tmp_path, text)))
    assert results.solution["energy"] == pytest.approx(0.5e6 * 4e-8 / 2)
    assert results.crosscheck is None
    assert results.maps is None
    assert results.passed
    errors = results_table(results)["errors"]
    assert errors == "geometric errors given in the study file"


SLOW = pytest.mark.slow
QUIET = "[checks]\npicture = false\n"


@pytest.mark.exudyn
@pytest.mark.parametrize("name", [
    name if name == "four_bar" else pytest.param(name, marks=SLOW)
    for name in BUILT_IN
])  # fmt: skip
def test_study_without_errors_reports_that_nothing_was_checked(tmp_path, name):
    """Every built-in robot is tested."""
    text = f'robot = "{name}"\nscales = [1.0, 0.5]\n{QUIET}'
    if name == "irsbot2":
        text += "[pose]\ntx = 0.0\ntz = -0.5\n"
    results = run_study(read_study(study_file(tmp_path, text), tmp_path / "out"))
    write_study(results)
    assert results.verdicts == {"reference": "no signal", "crosscheck": "no signal"}
    assert not results.passed
    assert "No independent check of these results was possible" in verdict(results)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Checks that were not possible" in page
    assert "the robot has no geometric errors" in page
    table = json.loads((tmp_path / "out" / "results.json").read_text())
    assert table["passed"] is False
    assert set(table["unchecked"]) == {"reference", "crosscheck"}


JUST_CONSTRAINED = """
robot = "hexapod"
scales = [1.0, 0.5]
[errors]
seed = 1
least = [0, 0, 0, 0, 0, 0]
most = [1e-3, 1e-3, 1e-3, 1e-4, 1e-4, 1e-4]
"""


@pytest.mark.exudyn
def test_study_reports_checks_that_were_not_possible(tmp_path):
    """The errors cause no energy, so only the simulation can check the study."""
    text = JUST_CONSTRAINED + QUIET
    results = run_study(read_study(study_file(tmp_path, text)))
    assert results.verdicts == {"reference": "no signal", "crosscheck": "passed"}
    assert set(results.unchecked) == {"reference"}
    assert results.passed  # the file does not request the reference check
    sentences = verdict(results)
    assert (
        "Checked independently: pose without clearances, by a multibody "
        "simulation (passed). No independent check covers the certified bounds. "
        "Checks that were not possible: reference."
    ) in sentences
    assert "1 of 2 passed" in report_page(results)
    text += "reference = true\ncrosscheck = false\n"
    results = run_study(read_study(study_file(tmp_path, text)))
    assert not results.passed


def test_study_without_a_reachable_point_in_its_map_does_not_pass(tmp_path):
    text = SMALL.replace("tz=-0.5:-0.4:0.1", "tz=-5:-4:0.5") + QUIET
    text += "crosscheck = false\n"
    results = run_study(read_study(study_file(tmp_path, text), tmp_path / "out"))
    write_study(results)
    assert results.verdicts == {"reference": "passed"}
    assert results.unchecked == {"maps": "none of the grid's points has a solution"}
    assert not results.passed
    assert "No point has a solution" in (tmp_path / "out" / "report.html").read_text()


def test_study_without_a_reference_solution_does_not_pass(tmp_path, monkeypatch):
    def lost(*_):
        raise RuntimeError("cvxpy: the problem is unbounded")

    monkeypatch.setattr(as_printed, "energy_as_printed", lost)
    text = SMALL + QUIET + "crosscheck = false\nmaps = false\n"
    results = run_study(read_study(study_file(tmp_path, text), tmp_path / "out"))
    write_study(results)
    assert results.verdicts == {"reference": "no answer"}
    assert not results.passed
    assert "Not compared: cvxpy: the problem" in report_page(results)


def test_headline_contains_the_bounds_at_the_pose_and_over_the_map(tmp_path):
    """At the pose, the bound equals that of ``assembly error``."""
    text = 'robot = "five_bar"\ngrid = "tx=-0.01:0.01:0.01,ty=0.15"\n'
    text += QUIET + "crosscheck = false\nreference = false\n"
    text += "[pose]\ntx = 0.0\nty = 0.15\n"
    results = run_study(read_study(study_file(tmp_path, text)))
    worst = worst_clearance(results)
    bounds = pose_error_of(place_robot(results.robot, results.study.pose), ["frozen"])
    bound = bounds["error"]["frozen"]["translation"]["upper"]
    assert worst["pose"]["translation"] == pytest.approx(bound, abs=1e-6)
    upper = results.maps["translation_error"].sel(bound="upper").values
    assert worst["map"]["translation"] == np.nanmax(upper)
    least = np.linalg.norm(results.solution["platform_screw"][3:])
    assert worst["pose"]["translation"] > 2e-5 > 10 * least
    sentences = verdict(results)
    assert f" and {1e3 * bound:.3g} mm from the nominal pose" in sentences
    assert " poses of the map, it is at most" in sentences
    assert f" and {1e3 * np.nanmax(upper):.3g} mm from the nominal pose" in sentences
    assert "(assumption frozen)" in sentences
    least = "In the minimum-energy solution, the platform is 0 mrad and 0 mm from"
    assert least in sentences
    lost = verdict(replace(results, error={}, maps=None))
    assert "No bound on the pose error within the clearances was found." in lost
    assert least in lost
    page = report_page(results)
    assert page.count("minimum energy") >= 6  # one row per component
    assert "any position without a change of deformation" in page
    assert "largest translation, eq. (27), over all clearances" in page


def test_study_of_a_robot_that_cannot_be_assembled_does_not_pass(tmp_path):
    frames = (Frame("a"), Frame("b", geometric_error=[0, 0, 0, 1e-3, 0, 0]))
    write_robot(Robot("stuck", "a", frames, (("a", "b"),)), tmp_path / "stuck.toml")
    results = run_study(read_study(study_file(tmp_path, 'robot = "stuck.toml"\n')))
    assert results.solution["status"] == "cannot assemble"
    assert not results.passed
    assert verdict(results).startswith(
        "No solution at this pose: cannot assemble, a ri"
    )


def test_robot_file_as_study_file_is_rejected(tmp_path):
    path = tmp_path / "arm.toml"
    robot = BUILT_IN["five_bar"]()
    write_robot(robot, path)
    with pytest.raises(BadInput, match="found a robot file, expected a study") as e:
        read_study(path)
    line = str(e.value).rpartition("with the one line ")[2]
    (tmp_path / "study.toml").write_text(line)
    assert read_study(tmp_path / "study.toml").robot == robot


@pytest.mark.parametrize(("old", "new", "message"), [
    ('robot = "irsbot2"', 'robot = "nowhere.toml"', "nowhere.toml\", neither a"),
    ('robot = "irsbot2"', "", "robot: missing; expected a built-in robot or a"),
    ("seed = 1", "", "errors.seed: missing; expected a whole number >= 0"),
    ("seed = 1", "seed = -1", "errors.seed: found -1, expected a whole number"),
    ("seed = 1", "seed = 1\nsigns = 'up'", "errors.signs: found 'up', expected"),
    ("[pose]", "[pose]\nx = 1", 'pose: unknown key "x"'),
    ("tx = 0.0", "tx = nan", "pose.tx: found nan, expected a finite number"),
    ("tz=-0.5:-0.4:0.1", "tz=-0.5:-0.4", 'grid tz: found "-0.5:-0.4", expected'),
    ("[pose]", "[poze]", 'unknown key "poze"; did you mean "pose"?'),
    ('"link_a"', '"link_q"', 'no frame "link_q"'),
    ('"link_a"', "3", "expected a list of frame names"),
    ("least = [1e-4,", "least = [1e-1,", "least: expected 0 <= least <= most"),
    ("least = [1e-4,", "least = [", "errors.least: found"),
    ("[pose]", "[links]\nsource = 'fea'\n[pose]", "links.surface: missing"),
    ("[pose]", "[links]\nsurface = 'no.stl'\n[pose]", "surface: no such file"),
    ("[pose]", "[checks]\nstiffness = true\n[pose]", "stiffness: found true"),
    ("[pose]", "[checks]\nmaps = 1\n[pose]", "checks.maps: found 1, expected true"),
    ("title", "scales = 3\ntitle", "scales: expected a list of factors"),
    ("title", "scales = ['a']\ntitle", "scales: found 'a' as number 1, expected"),
    ("title", "scales = [1, -1]\ntitle", "expected at least two different fact"),
    ("title", "title = 1 #", "title: found 1, expected a string"),
    *(("[pose]", f"[service]\n{line}\n[pose]", "service" + words) for line, words in (
        ("load = [1, 2]", ".load: found [1, 2] of length 2"),
        ("gravity = 9.81", ".gravity: found 9.81"),
        ("stiffness = 1", ".stiffness: found 1, expected true or false"),
        ("frequencies = -1", ".frequencies: found -1, expected a whole number"),
        ("frequencies = 2000", ".frequencies: found 2000, expected at most"),
        ("frequencies = 3", ".frequencies: irsbot2: found no moving mass"),
        ("lod = 1", ': unknown key "lod"; did you mean "load"?'),
    )),
])  # fmt: skip
def test_invalid_study_file_is_rejected(tmp_path, old, new, message):
    path = study_file(tmp_path, SMALL.replace(old, new, 1))
    with pytest.raises(BadInput) as error:
        read_study(path)
    text = str(error.value)
    assert message in text
    assert "\n" not in text
    assert str(tmp_path) in text
    assert [p.name for p in tmp_path.iterdir()] == ["study.toml"]


def test_file_as_output_folder_is_rejected(tmp_path):
    (tmp_path / "taken").write_text("mine")
    path = study_file(tmp_path, SMALL)
    with pytest.raises(BadInput, match="found a file, expected a folder or nothing"):
        read_study(path, tmp_path / "taken")


def test_unreachable_study_pose_is_rejected(tmp_path):
    path = study_file(tmp_path, SMALL.replace("tz = -0.5", "tz = -0.9"))
    seen = []
    with pytest.raises(BadInput, match="cannot be reached"):
        run_study(read_study(path), lambda *step: seen.append(step))
    assert seen == []


@pytest.mark.slow
@pytest.mark.exudyn
def test_stiffness_of_the_finite_element_study_has_converged(tmp_path):
    """The converged K_RX is 1 032 277 N m/rad, and that of the beam is 1 067 585."""
    study = read_study(EXAMPLE, tmp_path / "out")
    results = run_study(study)
    write_study(results)
    assert results.passed
    (first, *_) = results.stiffness.values()
    error = first["fea"][1, 1] / 1_032_277 - 1
    assert abs(error) < 0.005
    assert abs(error) < 5 * first["relative_error_estimate"]
    assert first["euler"][1, 1] == pytest.approx(1_067_585.468, rel=1e-9)
    assert first["timoshenko"][1, 1] == pytest.approx(1_015_962.169, rel=1e-9)
    assert len(results.stiffness) == 4
    assert irsbot2_with(NUMBERS["cases"][0]).errors == pytest.approx(
        results.robot.errors, abs=0
    )


def test_study_without_an_output_folder_writes_no_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = study_file(tmp_path, 'robot = "five_bar"\n[checks]\ncrosscheck = false\n')
    read = read_study(file)
    assert ff.run_study(file).solution["status"] == "ok"
    assert ff.run_study(read).solution["status"] == "ok"
    assert list(tmp_path.iterdir()) == [file]
    ff.run_study(read, output="report")
    names = {path.name for path in (tmp_path / "report").iterdir()}
    assert names == {"report.html", "results.json"}


BAR = """
name = "bar"
platform = "tip"
[[frame]]
name = "drive"
parent = "base"
joint = "revolute"
actuated = true
[[frame]]
name = "tip"
parent = "drive"
translation = [0.5, 0, 0]
link = { beam = { radius = 0.02 }, young = 7e10, poisson = 0.3 }
[[effect]]
"""


def test_study_applies_the_effects_of_the_robot(tmp_path):
    """A joint zero turns the bar; the foundation deflects under F by F / k."""
    (tmp_path / "bar.toml").write_text(
        BAR + 'name = "encoder_offset"\nparameters = { drive = 1e-3 }\n[[effect]]\n'
        'name = "base_compliance"\nparameters = { "stiffness.tx" = 1e7 }\n'
    )
    text = (
        'robot = "bar.toml"\n[service]\nload = [0, 0, 0, 100, 0, 0]\n'
        "[checks]\ncrosscheck = false\npicture = false\n"
    )
    results = run_study(read_study(study_file(tmp_path, text)))
    screw = results.solution["platform_screw"]
    np.testing.assert_allclose(screw, [0, 0, 1e-3, 0, 5e-4, 0], atol=1e-12)
    stretch = 0.5 / (7e10 * np.pi * 0.02**2)
    axial = results.service["deflection"][3]
    assert axial == pytest.approx(100 * (1 / 1e7 + stretch), rel=1e-9)


@pytest.mark.parametrize(
    "effect",
    ['"thermal_expansion"\nparameters = { tip = 1e-5 }',
     '"self_weight"\nparameters = { "g.z" = -9.81 }'],
)  # fmt: skip
def test_study_rejects_effects_that_it_cannot_apply(effect, tmp_path):
    (tmp_path / "bar.toml").write_text(BAR + f"name = {effect}\n")
    with pytest.raises(BadInput, match="assembly solve or validation crosscheck"):
        run_study(read_study(study_file(tmp_path, 'robot = "bar.toml"\n')))
