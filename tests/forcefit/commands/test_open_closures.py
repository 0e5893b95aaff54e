"""Options ``--rest`` and ``--mismatch``, which close loops with a gap."""

import csv
import json

import numpy as np
import pytest

# A beam along x is clamped at both ends.  Its far support is displaced by OFF along y.
OFF, LENGTH, RADIUS, YOUNG = 1e-4, 1.0, 0.01, 7e10
GAP = f"""
name = "gap"
platform = "tip"
[[frame]]
name = "tip"
parent = "base"
translation = [{LENGTH}, 0, 0]
link = {{ beam = {{ radius = {RADIUS} }}, young = 7e10, poisson = 0.3 }}
[[frame]]
name = "post"
parent = "base"
translation = [{LENGTH}, {OFF}, 0]
[[closure]]
frames = ["tip", "post"]
"""
BENT = 12 * YOUNG * np.pi * RADIUS**4 / 4 / LENGTH**3 * OFF**2 / 2  # [J]
RELATIVE = 1e-3  # relative tolerance, because the formula neglects shear

# The platform is connected to two driven slides along x with different coordinates.
STIFF, APART = (2e6, 3e6), 1e-5
SLIDE = """
[[frame]]
name = "{name}"
parent = "base"
rotation = [0, 1.5707963267948966, 0]
joint = "prismatic"
actuated = true
position = {at}
joint_stiffness = [inf, inf, inf, inf, inf, {stiffness}]
[[frame]]
name = "{tip}"
parent = "{name}"
rotation = [0, -1.5707963267948966, 0]
"""
SLIDES = (
    'name = "slides"\nplatform = "tip"\n'
    + SLIDE.format(name="one", tip="tip", at=0.3, stiffness=STIFF[0])
    + SLIDE.format(name="two", tip="end", at=0.3 + APART, stiffness=STIFF[1])
    + '[[closure]]\nframes = ["tip", "end"]\n'
)
PRELOADED = APART**2 / 2 * STIFF[0] * STIFF[1] / sum(STIFF)  # [J] springs in series

ROBOTS = [
    (GAP, ["--rest", "tip"], 'rest = "tip"', BENT),
    (GAP, ["--rest", "post"], 'rest = "post"', BENT),
    (SLIDES, ["--mismatch", "spring"], 'mismatch = "spring"', PRELOADED),
]
robots = pytest.mark.parametrize(
    ("robot", "words", "key", "energy"), ROBOTS, ids=["tip", "post", "drives"]
)
# a negligible error of 1e-15 m along the beam or the slides
TINY = """[[errors]]
frames = ["tip"]
distribution = "normal"
deviation = [0, 0, 0, 1e-15, 0, 0]
"""


@pytest.fixture
def files(robot, tmp_path):
    (tmp_path / "robot.toml").write_text(robot)
    (tmp_path / "tiny.toml").write_text(TINY)
    return tmp_path


@robots
def test_statistics_includes_the_gap_in_every_draw(files, run, words, key, energy):
    """The gap is a constant error in all draws."""
    command = ["assembly", "statistics", files / "robot.toml"]
    options = ["--errors", files / "tiny.toml", "--draws", "20", "--no-margins"]
    status, _, err = run(*command, *options)
    assert status == 2
    assert f"{words[0]} " in err
    status, out, err = run(*command, *options, *words, "--json", "-")
    assert status == 0
    mean = json.loads(out)["quantities"]["energy"]["mean"]
    assert mean["value"] == pytest.approx(energy, rel=RELATIVE)
    assert err.count("forcefit: note: ") == 1


@robots
@pytest.mark.parametrize("drawn", [False, True])
def test_sweep_includes_the_gap_at_every_point(files, run, words, key, energy, drawn):
    options = ["--grid", "tz=0", "-o", files / "x.nc", "--csv", files / "x.csv"]
    if drawn:
        options += ["--errors", files / "tiny.toml", "--draws", "2"]
    status, *_ = run("assembly", "sweep", files / "robot.toml", *options, *words)
    assert status == 0
    with (files / "x.csv").open() as table:
        rows = list(csv.DictReader(table))
    assert len(rows) == 1 + drawn
    for row in rows:
        assert float(row["energy [J]"]) == pytest.approx(energy, rel=RELATIVE)


@robots
def test_study_includes_the_energy_of_the_gap(files, run, words, key, energy):
    study = f'robot = "robot.toml"\noutput = "{files}/out"\n{key}\n'
    checks = "[checks]\npicture = false\ncrosscheck = false\nreference = false\n"
    (files / "study.toml").write_text(study + checks)
    assert run("study", files / "study.toml")[0] == 0
    results = json.loads((files / "out" / "results.json").read_text())
    assert results["solution"]["energy"] == pytest.approx(energy, rel=RELATIVE)
    assert "gap of the closure" in results["errors"] or "drives" in results["errors"]


def test_study_adds_its_errors_to_the_gap(run, tmp_path):
    """An error of the same size in the opposite direction closes the gap."""
    (tmp_path / "robot.toml").write_text(GAP)
    text = (
        f'robot = "robot.toml"\noutput = "{tmp_path}/out"\nrest = "tip"\n'
        f"[errors.explicit]\npost = [0, 0, 0, 0, {-OFF}, 0]\n"
        "[checks]\npicture = false\ncrosscheck = false\nreference = false\n"
    )
    (tmp_path / "study.toml").write_text(text)
    assert run("study", tmp_path / "study.toml")[0] == 0
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert results["solution"]["energy"] < 1e-12 * BENT


@pytest.mark.parametrize(
    ("line", "message"),
    [('rest = "ankle"', 'study.toml: rest: no frame "ankle"'),
     ('mismatch = "glue"', "study.toml: mismatch: found"),
     ("rest = 3", "study.toml: rest: found")],
)  # fmt: skip
def test_study_rejects_invalid_rest_or_mismatch(run, tmp_path, line, message):
    (tmp_path / "robot.toml").write_text(GAP)
    (tmp_path / "study.toml").write_text(f'robot = "robot.toml"\n{line}\n')
    status, out, err = run("study", tmp_path / "study.toml")
    assert (status, out) == (2, "")
    assert message in err


@robots
def test_tolerances_accepts_rest_and_mismatch(files, run, words, key, energy):
    """Without an option that closes the loop, the command fails."""
    command = ["assembly", "tolerances", files / "robot.toml", "--grid", "tz=0"]
    assert run(*command)[0] == 2
    status, out, err = run(*command, *words, "--json", "-")
    assert status == 0
    assert json.loads(out)["postures"] == 1
    assert err.count("forcefit: note: ") == 1


def test_mismatch_at_home_is_a_drive_error_at_other_poses(run, tmp_path):
    """Both slides move by the same distance, so that their preload is constant."""
    (tmp_path / "robot.toml").write_text(SLIDES)
    words = ["--mismatch", "spring", "--pose", "tx=0.42", "--json", "-"]
    status, out, _ = run("assembly", "solve", tmp_path / "robot.toml", *words)
    assert status == 0
    assert json.loads(out)["energy"] == pytest.approx(PRELOADED, rel=RELATIVE)


def test_sweep_over_drive_coordinates_rejects_mismatch(run, tmp_path):
    (tmp_path / "robot.toml").write_text(SLIDES)
    words = ["--mismatch", "spring", "--grid", "q.one=0.3", "-o", tmp_path / "x.nc"]
    status, _, err = run("assembly", "sweep", tmp_path / "robot.toml", *words)
    assert status == 2
    assert "--mismatch: found points given by drive" in err
    assert not (tmp_path / "x.nc").exists()


@robots
def test_converted_robot_has_closed_loops_and_the_same_energy(
    files, run, words, key, energy
):
    """The converted file has closed loops and requires neither option."""
    target = files / "closed.toml"
    assert run("convert", files / "robot.toml", "-o", target)[0] == 2
    assert not target.exists()
    assert run("convert", files / "robot.toml", *words, "-o", target)[0] == 0
    status, out, _ = run("assembly", "solve", target, "--json", "-")
    assert status == 0
    assert json.loads(out)["energy"] == pytest.approx(energy, rel=RELATIVE)


def test_convert_rejects_rest_for_urdf(run, tmp_path):
    (tmp_path / "r.urdf").write_text("<robot name='r'><link name='a'/></robot>")
    words = ["--rest", "a", "-o", tmp_path / "r.toml"]
    status, _, err = run("convert", tmp_path / "r.urdf", *words)
    assert status == 2
    assert "found together with --rest or --mismatch, expected a robot file" in err
