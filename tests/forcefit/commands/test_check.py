"""``forcefit check`` reports all messages that the reader of a file would raise."""

import copy
import itertools
import json
import shutil
import tomllib
from pathlib import Path

import pytest

from forcefit.assembly.exchange.robot_files import load_robot
from forcefit.assembly.files.toml_text import toml_value
from forcefit.assembly.model.error_distributions import read_sources
from forcefit.assembly.robots import BUILT_IN
from forcefit.assembly.statistics.tolerance_file import read_plan
from forcefit.inputs.errors import BadInput
from forcefit.inputs.mending import MOST_MESSAGES, all_messages
from forcefit.validation.campaign.campaign_file import read_campaign
from forcefit.validation.study.study_file import read_study
from tests.robot_files_for_tests import FOUR_BAR
from tests.schemas_for_tests import validator

ROOT = Path(__file__).parents[3]
EXAMPLES = ROOT / "examples"
IRSBOT2 = BUILT_IN["irsbot2"]()
STUDY = """
robot = "irsbot2"
grid = "tx=-0.2:0.2:0.1,tz=-0.5"
scales = [1.0, 0.5]

[errors]
frames = ["link_a", "link_b"]
least = [0, 0, 0, 0, 0, 0]
most = [1e-3, 1e-3, 1e-3, 1e-5, 1e-5, 1e-5]
seed = 1

[pose]
tx = 0.1
tz = -0.5

[service]
load = [0, 0, 0, 0, 0, -50]
"""
CAMPAIGN = (EXAMPLES / "campaign/campaign.toml").read_text("utf-8")
PLAN = (EXAMPLES / "tolerance_allocation/mostly.toml").read_text("utf-8")
ERRORS = (EXAMPLES / "irsbot2_errors.toml").read_text("utf-8")
DRAWN = (EXAMPLES / "drawn/tricept.toml").read_text("utf-8")
# for each file type: valid text, command options, reader, and mistakes to insert
KINDS = {
    "robot of frames": (FOUR_BAR, (), load_robot, [
        ("translation = [0.3, 0, 0]", 'translation = [0.3, 0, "a"]'),
        ("radial = 29e-6", "radial = -1"),
        ("young = 6e10", "yuong = 6e10"),
        ("mass = 1.2", "masss = 1.2"),
        ('parent = "rocker"', 'parent = "roker"'),
        ('["coupler", "seat"]', '["coupler", "set"]'),
        ('platform = "coupler"', 'platform = "copler"'),
        ("[1e8, 1e8, 1.0, 3e8, 3e8, inf]", "[1e8, 1e8, 1.0]"),
        ('joint = "revolute"\nactuated', 'joint = "revolut"\nactuated'),
    ]),
    "robot of bodies": (DRAWN, (), load_robot, [
        ('radius = "60 mm"', 'radius = "60 kg"'),
        ("mass = 40", "mass = -40"),
        ('platform_at = [0, 0, "', 'platform_at = [0, 0, "m'),
        ('between = ["tube", "platform"]', 'between = ["tub", "platform"]'),
        ("drive_stiffness = 1.5e8", "drive_stifness = 1.5e8"),
        ("count = 3", "count = 0"),
        ('name = "flange"\ntype = "fixed"', 'name = "flange"\ntype = "fixd"'),
        ("axis2 = [0, 1, 0]", "axis2 = [1, 0, 0]"),
        ('name = "sleeve"', 'name = "sleeve"\n[[body]]\nname = "lost"'),
    ]),
    "study": (STUDY, (), read_study, [
        ('frames = ["link_a", "link_b"]', 'frames = ["link_a", "lnk_b"]'),
        ("tx = 0.1", 'tx = "0.1"'),
        ("scales = [1.0, 0.5]", "scales = [1.0, -0.5]"),
        ("load = [0, 0, 0, 0, 0, -50]", "load = [0, 0, -50]"),
        ("[service]", "colour = 1\n[service]"),
    ]),
    "campaign": (CAMPAIGN, (), read_campaign, [
        ('"known"', '"unknwon"'),
        ("rotation = 1e-05", "rotation = -1"),
        ("reference_point = [0.0, 0.0, 0.0]", "reference_point = [0.0, 0.0]"),
        ("[noise]", "[noise]\ntime = 3"),
    ]),
    "tolerance plan": (PLAN, ("--robot", "irsbot2"), lambda f: read_plan(f, IRSBOT2), [
        ("yield = 0.99", "yield = 99"),
        ('components = ["RX"]', 'components = ["RW"]'),
        ('["loop2_platform", "tip"]\ncomponents = ["TX"',
         '["loop3_platform", "tip"]\ncomponents = ["TX"'),
        ("margin_free = 1.0", "margin_fre = 1.0"),
        ("draws = 500", "draws = 0"),
    ]),
    "errors": (ERRORS, ("--robot", "irsbot2"), lambda f: read_sources(f, IRSBOT2), [
        ('"elbow_a", "link_a"', '"elbow_a", "lnk_a"'),
        ('"literal"', '"litteral"'),
        ("most = [2e-2,", "mst = [2e-2,"),
    ]),
}  # fmt: skip


def written(folder, kind, mistakes):
    """Write a file with mistakes; for a campaign, copy the other example files."""
    text = KINDS[kind][0]
    for sound, wrong in mistakes:
        assert text.count(sound) == 1, sound
        text = text.replace(sound, wrong)
    if kind == "campaign":
        shutil.copytree(EXAMPLES / "campaign", folder / "lab", dirs_exist_ok=True)
        file = folder / "lab/campaign.toml"
    else:
        file = folder / "file.toml"
    file.write_text(text, "utf-8")
    return file


def first_message(read, file):
    """Return the message of the error that a reader raises."""
    with pytest.raises(BadInput) as stopped:
        read(file)
    return str(stopped.value)


@pytest.mark.parametrize("kind", KINDS)
def test_check_reports_each_of_three_mistakes(tmp_path, kind):
    _, _, read, mistakes = KINDS[kind]
    alone = {m: first_message(read, written(tmp_path, kind, [m])) for m in mistakes}
    assert len(set(alone.values())) == len(mistakes)
    for three in itertools.combinations(mistakes, 3):
        file = written(tmp_path, kind, three)
        assert sorted(all_messages(lambda f=file: read(f))) == sorted(
            alone[m] for m in three
        )


@pytest.mark.parametrize("kind", KINDS)
def test_check_prints_every_message_and_exits_with_status_2(run, tmp_path, kind):
    _, options, read, mistakes = KINDS[kind]
    alone = [first_message(read, written(tmp_path, kind, [m])) for m in mistakes[:3]]
    file = written(tmp_path, kind, mistakes[:3])
    status, out, err = run("check", file, *options)
    assert (status, err) == (2, "")
    assert sorted(out.splitlines()) == sorted(alone)
    _, out, _ = run("check", file, *options, "--json", "-")
    found = json.loads(out)
    assert not list(validator("check").iter_errors(found))
    assert found["passed"] is False
    assert sorted(found["files"][0]["messages"]) == sorted(alone)


def test_check_reports_every_invalid_cell(tmp_path):
    file = written(tmp_path, "campaign", [])
    table = file.with_name("measurements.csv")
    lines = table.read_text("utf-8").split("\n")
    for number, wrong in ((3, "2,1"), (5, ""), (8, "abc")):
        cells = lines[number].split(",")
        cells[2] = f'"{wrong}"'
        lines[number] = ",".join(cells)
    table.write_text("\n".join(lines), "utf-8")
    messages = all_messages(lambda: read_campaign(file))
    places = [f'{table}: line {n} (id "m00{n - 1}"), q.joint2' for n in (4, 6, 9)]
    assert [m.partition(": found")[0] for m in messages] == places


def test_check_limits_the_number_of_messages(tmp_path, run):
    text = (EXAMPLES / "campaign/measurements.csv").read_text("utf-8")
    file = written(tmp_path, "campaign", [])
    header, *rows = text.strip().split("\n")
    cells = [row.split(",") for row in rows]
    in_degrees = [
        ",".join([f"{c[0]}.{k}", "200", *c[2:]]) for k in (1, 2) for c in cells
    ]
    file.with_name("measurements.csv").write_text("\n".join([header, *in_degrees]))
    assert len(in_degrees) > MOST_MESSAGES
    status, out, _ = run("check", file.parent)
    assert status == 2
    assert out.count("expected an angle in rad") == MOST_MESSAGES
    assert out.splitlines()[-1] == f"{file.parent}: there may be more mistakes"


@pytest.mark.parametrize(("text", "place"), [
    (FOUR_BAR.replace("[0.5, 0.0, 0.0]\nlink", "[5.0, 0.0, 0.0]\nlink"), "closure"),
    ("name = ", "not valid TOML"),
    ("a = 1\n", "unknown type of file"),
])  # fmt: skip
def test_mistake_without_a_location_has_one_message(
    run, tmp_path, text, place
):  # fmt: skip
    file = tmp_path / "file.toml"
    file.write_text(text)
    status, out, _ = run("check", file)
    assert status == 2
    assert place in out
    assert len(out.splitlines()) == 1


def test_check_reports_no_gap_caused_by_a_replaced_value(tmp_path):
    sound, wrong = KINDS["robot of frames"][3][0]
    file = written(tmp_path, "robot of frames", [(sound, wrong)])
    assert len(all_messages(lambda: load_robot(file))) == 1


def test_body_with_an_invalid_link_is_not_reported_as_missing(tmp_path):
    sound = '{ beam = { radius = "60 mm", inner_radius = "45 mm" }'
    assert sound in DRAWN
    file = tmp_path / "tricept.toml"
    file.write_text(DRAWN.replace(sound, "{ beam = 3"), "utf-8")
    found = all_messages(lambda: load_robot(file))
    assert found
    assert all('body "tube".link' in message for message in found), found


OF_IRSBOT2 = [EXAMPLES / "irsbot2_errors.toml",
              *sorted((EXAMPLES / "tolerance_allocation").glob("*.toml"))]  # fmt: skip
OTHERS = [
    EXAMPLES / "irsbot2.toml", EXAMPLES / "campaign", EXAMPLES / "campaign/robot.toml",
    EXAMPLES / "ipa_ur10/ur10.toml", EXAMPLES / "voron/robot.toml",
    *sorted((EXAMPLES / "drawn").glob("*.toml")),
    *sorted((EXAMPLES / "serial_robots").glob("*.toml")),
]  # fmt: skip


@pytest.mark.parametrize(("files", "options"), [
    (OTHERS, ()),
    (OF_IRSBOT2, ("--robot", "irsbot2")),
    ([EXAMPLES / "hexapod_errors.toml"], ("--robot", "hexapod")),
])  # fmt: skip
def test_check_finds_no_mistakes_in_examples(run, files, options):
    status, out, err = run("check", *files, *options)
    assert (status, err) == (0, "")
    assert [line.split(": ")[:2] for line in out.splitlines()] == [
        ["ok", str(file)] for file in files
    ]


def test_check_requires_a_robot_for_files_with_frame_names(run):
    status, out, _ = run("check", EXAMPLES / "hexapod_errors.toml")
    assert status == 2
    assert "expected --robot ROBOT" in out


WRONG = (-1, 0, "x", [], {}, [1, "a"], True, 1e300, float("nan"), [0.0] * 6, "base")


def damaged(content, rng):
    """Return a copy of file content with some values or keys changed or removed."""
    content = copy.deepcopy(content)
    for _ in range(rng.integers(1, 5)):
        inner = content
        while True:
            keys = list(inner) if isinstance(inner, dict) else list(range(len(inner)))
            if not keys:
                break
            key = keys[rng.integers(len(keys))]
            if isinstance(inner[key], dict | list) and rng.random() < 0.7:
                inner = inner[key]
                continue
            how = rng.random()
            if how < 0.7:
                inner[key] = WRONG[rng.integers(len(WRONG))]
            elif isinstance(inner, dict) and how < 0.85:
                inner[f"{key}x"] = inner.pop(key)
            else:
                del inner[key]
            break
    return content


def stopped_by(read, file):
    """Return the error message of a reader in a list, empty for a valid file."""
    try:
        read(file)
    except BadInput as error:
        return [str(error)]
    return []


@pytest.mark.parametrize("kind", ["robot of frames", "robot of bodies", "study",
                                  "tolerance plan", "errors"])  # fmt: skip
def test_first_message_of_check_equals_that_of_the_reader(tmp_path, rng, kind):
    text, _, read, _ = KINDS[kind]
    content = tomllib.loads(text)
    file = tmp_path / "file.toml"
    for _ in range(30):
        lines = [f"{k} = {toml_value(v)}" for k, v in damaged(content, rng).items()]
        file.write_text("\n".join(lines), "utf-8")
        messages = all_messages(lambda: read(file))
        assert messages[:1] == stopped_by(read, file)
        assert len(set(messages)) == len(messages)
