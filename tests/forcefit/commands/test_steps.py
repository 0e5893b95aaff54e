"""The command ``forcefit assembly steps``."""

import json

import pytest

from tests.pages_for_tests import parse

LEG = """
[[frame]]
name = "leg{i}"
parent = "base"
link = {{ stiffness = [
  [1e9, 0, 0, 0, 0, 0], [0, 1e9, 0, 0, 0, 0], [0, 0, 1e9, 0, 0, 0],
  [0, 0, 0, 1e9, 0, 0], [0, 0, 0, 0, 1e9, 0], [0, 0, 0, 0, 0, {k}]] }}
geometric_error = [0, 0, 0, 0, 0, {d}]
[[closure]]
frames = ["platform", "leg{i}"]
"""
ROBOT = """
name = "three legs"
platform = "platform"
[[frame]]
name = "guide"
parent = "base"
joint = "prismatic"
[[frame]]
name = "platform"
parent = "guide"
""" + "".join(
    LEG.format(i=i, k=k, d=d)
    for i, k, d in ((1, 1e6, 30e-6), (2, 2e6, -20e-6), (3, 3e6, 50e-6))
)  # fmt: skip
JOINS = "".join(f'[[step]]\njoin = ["platform", "leg{i}"]\n' for i in (1, 2, 3))
SLOT = (
    '[[step]]\njoin = ["leg1", "platform"]\n[[step]]\njoin = ["platform", "leg2"]\n'
    '[[step]]\nclamp = "platform"\nat = { tz = "10 um" }\n'
    '[[step]]\njoin = ["platform", "leg3"]\nlocked = ["tz"]\n'
    '[[step]]\nrelease = "clamp platform"\n'
    '[[step]]\nmeasure = "platform"\ncomponents = ["tz"]\n'
)


@pytest.fixture
def files(tmp_path):
    """Return a function that writes the robot and a plan, and returns their paths."""

    def write(plan):
        (tmp_path / "robot.toml").write_text(ROBOT)
        (tmp_path / "plan.toml").write_text(plan)
        return tmp_path / "robot.toml", tmp_path / "plan.toml"

    return write


def test_step_forces_and_energies_equal_spring_calculation(run, files):
    """The springs have x = sum k d / sum k.

    The last leg closes a gap of 53.3 um with 80 N and 2.133 mJ.
    """
    status, out, _ = run("assembly", "steps", *files(JOINS), "--json", "-")
    results = json.loads(out)
    assert status == 0
    last = results["steps"][-1]
    assert last["closing_force"] == pytest.approx(80.0)
    assert last["work"] == pytest.approx(2.1333333e-3)
    assert results["energy"] == pytest.approx(2.9666667e-3)
    assert results["platform_screw"][5] == pytest.approx(140 / 6 * 1e-6)
    assert results["work"] == pytest.approx(results["energy"])
    assert "does not change the assembled machine" in results["remarks"][0]


def test_steps_reports_reading_and_spring_back(run, files):
    status, out, _ = run("assembly", "steps", *files(SLOT), "--json", "-")
    results = json.loads(out)
    assert status == 0
    release, reading = results["steps"][4:]
    assert reading["reading"] == pytest.approx([10e-6 / 3])
    assert release["spring_back"][5] == pytest.approx(10e-6 / 3 - 10e-6)
    assert "the order matters" in results["remarks"][0]
    status, out, _ = run("assembly", "steps", *files(SLOT))
    assert "springs back" in out


def test_best_order_has_a_bound(run, files):
    words = ("assembly", "steps", *files(JOINS), "--best", "force")
    status, out, _ = run(*words, "--json", "-")
    order = json.loads(out)["order"]
    assert status == 0
    assert order["value"] == order["bound"] <= order["given"]
    assert sorted(order["steps"]) == [f"join platform - leg{i}" for i in (1, 2, 3)]
    assert "minimum force" in run(*words)[1]


def test_quantiles_equal_spring_calculation(run, files, tmp_path):
    """One leg has a uniform error; the platform moves by a sixth of this error."""
    errors = tmp_path / "errors.toml"
    errors.write_text('[[errors]]\nframes = ["leg1"]\nmost = [0, 0, 0, 0, 0, 3e-5]\n')
    words = ("assembly", "steps", *files(JOINS), "--errors", errors, "--draws", "4000")
    status, out, _ = run(*words, "--json", "-")
    found = json.loads(out)["quantiles"]["join platform - leg3"]["translation"]
    assert status == 0
    # |x| is uniform up to 5 um; the standard error of the quantiles is 0.04 um
    assert found["0.95"] == pytest.approx(0.95 * 5e-6, abs=0.1e-6)
    assert found["0.5"] == pytest.approx(0.5 * 5e-6, abs=0.2e-6)


@pytest.mark.parametrize(("plan", "text"), [
    ('[[step]]\njoin = ["platform", "leg9"]\n', "step[1].join: found"),
    ('[[step]]\njoin = "leg1"\n', "no clearance and no motion to bolt"),
    ('[[step]]\nrelease = "clamp"\n', 'step[1] "release clamp".release'),
    (JOINS + '[[step]]\njoin = ["platform", "leg1"]\n', "that is joined already"),
    (2 * '[[step]]\nname = "a"\nmeasure = "leg1"\n', "the name of an earlier"),
    ('[[step]]\nfix = "leg1"\njoin = "leg2"\n', "found fix and join"),
    ('[[step]]\nname = "a"\n', "found no type of step"),
    ('[[step]]\njion = "leg1"\n', 'step[1]: unknown key "jion"; did you mean "join"?'),
    ('[[step]]\nfix = "lge1"\n', 'did you mean "leg1"'),
    ('[[step]]\npreload = "leg1"\n', "load: missing"),
    ('[[step]]\npreload = "leg1"\nload = { fz = "5 N" }\n', "load.fz"),
    ('[[step]]\nclamp = "leg1"\nat = { tz = "1 kg" }\n', "at.tz"),
    ('[[step]]\nclamp = "leg1"\nat = { up = 1 }\n', "up"),
    ('[[step]]\nfix = "leg1"\nstiffness = { tz = -1 }\n', "stiffness.tz"),
    ('[[step]]\nmeasure = "leg1"\ncomponents = ["z"]\n', "components"),
    ('[[step]]\njoin = ["platform", "leg1"]\nleave_open = true\n', "force_limit"),
    ('[[step]]\nadjust = "leg1"\ncomponents = ["tz"]\nreading = "platform"\n'
     'of = ["rx", "tz"]\n', "found rotations and translations together"),
    ('[[step]]\nadjust = "leg1"\ncomponents = ["tz", "rx"]\nincrement = 1e-5\n'
     'reading = "platform"\nof = ["tz"]\n',
     "step[1].increment: found for rotations and translations together"),
    ('[[step]]\nname = "platform - leg2"\njoin = ["platform", "leg1"]\n',
     "the name of a closure"),
    ('[[step]]\nname = "gravity"\npreload = "leg1"\nload = { fz = 1 }\n',
     "the name of the weights"),
    ("steps = 3\n", "steps"),
    ("", "step: missing"),
])  # fmt: skip
def test_invalid_step_has_a_one_line_message(run, files, plan, text):
    status, out, err = run("assembly", "steps", *files(plan))
    assert status == 2
    assert text in err
    assert out == ""
    assert err.count("\n") == 1


def test_message_names_the_step_that_fails(run, tmp_path):
    """Two rigid legs of different lengths."""
    robot = tmp_path / "robot.toml"
    robot.write_text(
        'platform = "tool"\n[[frame]]\nname = "tool"\nparent = "base"\n'
        '[[frame]]\nname = "stop"\nparent = "base"\n'
        "geometric_error = [0, 0, 0, 0, 0, 1e-4]\n"
        '[[closure]]\nframes = ["tool", "stop"]\n'
    )
    plan = tmp_path / "plan.toml"
    plan.write_text('[[step]]\njoin = ["tool", "stop"]\n')
    status, out, _ = run("assembly", "steps", robot, plan)
    assert status == 1
    assert 'step "join tool - stop"' in out


def test_steps_report_has_a_table_of_the_steps(run, files, tmp_path):
    page = tmp_path / "steps.html"
    status, _, _ = run("assembly", "steps", *files(SLOT), "--report", page)
    table = parse(page.read_text()).table("step")
    assert status == 0
    assert [row[0].text for row in table[1:]][2] == "clamp platform"
    # force of two springs: -20 um at 1e6 N/m and 30 um at 2e6 N/m
    assert table[3][4].value == pytest.approx(40.0)
    # energy of the two springs [J]
    assert table[3][1].value == pytest.approx(1.1e-3)


def test_equal_step_names_are_numbered(run, files):
    plan = JOINS + 2 * '[[step]]\nmeasure = "platform"\ncomponents = ["tz"]\n'
    status, out, _ = run("assembly", "steps", *files(plan), "--json", "-")
    names = [step["name"] for step in json.loads(out)["steps"]]
    assert status == 0
    assert names[3:] == ["measure platform", "measure platform 2"]
