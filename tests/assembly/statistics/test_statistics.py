"""The function ``statistics`` and its results."""

import json
from pathlib import Path

import numpy as np
import pytest

import forcefit as ff
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Frame, Robot

pytest.importorskip("xarray")
NORMAL = """errors = [
    { frames = ["tip"], distribution = "normal", deviation = [0, 0, 0, 0, 0, 1e-4] }
]"""
UNIFORM = 'errors = [{ frames = ["tip"], most = [0, 0, 0, 3e-5, 0, 4e-5] }]'


@pytest.fixture
def tip():
    """Return a rigid frame on the base, whose error is the pose error."""
    return home_posture(Robot("block", "tip", (Frame("tip"),)))


@pytest.fixture
def normal(tmp_path):
    file = tmp_path / "normal.toml"
    file.write_text(NORMAL)
    return file


def test_yield_of_a_normal_error_equals_closed_form(tip, normal):
    """P(|x| <= sigma) is 0.6827, and the median of |x| is 0.6745 sigma."""
    found = ff.statistics(tip, normal, draws=4000, limits={"translation": 1e-4})
    share = found.summary["within_limits"]
    assert share["lower"] < 0.68269 < share["upper"]
    median = found.summary["quantities"]["translation"]["quantiles"]["0.5"]
    assert median["lower"] < 0.67449e-4 < median["upper"]


def test_statistics_convert_to_a_table_and_a_figure(tip, normal):
    file = normal.with_suffix(".nc")
    found = ff.statistics(tip, normal, draws=50, output=file)
    table = found.to_pandas()
    assert len(table) == 50
    np.testing.assert_array_equal(table["translation", ""], found.data["translation"])
    drawn = [ff.show(found), ff.show(found.data, kind="histogram"), ff.show(file)]
    titles = {tuple(axes.get_title() for axes in one.axes) for one in drawn}
    titles.add(tuple(axes.get_title() for axes in found.plot().axes))
    assert len(titles) == 1
    assert "translation [clearance worst]" in repr(found)


def test_statistics_in_python_equal_those_of_the_command(run):
    robot = Path(__file__).parents[3] / "examples" / "drawn" / "four_bar.toml"
    found = ff.statistics(
        ff.place_robot(ff.load_robot(robot)), draws=40, seed=3,
        limits={"translation": 1e-4}, load={"fx": 2.0}, capability=True,
    )  # fmt: skip
    status, out, _ = run(
        "assembly", "statistics", robot, "--draws", 40, "--seed", 3, "--capability",
        "--limit", "translation=1e-4", "--load", "fx=2", "--json", "-",
    )  # fmt: skip
    assert status == 0
    expected = json.loads(out)
    for key in ("exceeds", "within_limits", "capability", "platform_screw"):
        ours = json.loads(json.dumps(found.summary[key], default=np.ndarray.tolist))
        assert ours == expected[key], key


def test_worst_pose_of_two_uniform_errors_equals_closed_form(tip, tmp_path):
    file = tmp_path / "uniform.toml"
    file.write_text(UNIFORM)
    worst = ff.worst_pose(tip, file)
    assert worst.attained == pytest.approx(5e-5, rel=1e-9)
    assert worst.bound == pytest.approx(5e-5, rel=1e-3)
    with pytest.raises(ff.BadInput, match="quantity: found 'translaton'"):
        ff.worst_pose(tip, file, "translaton")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"clearance": "wrost"}, "clearance: found 'wrost'; did you mean \"worst\""),
        ({"by": "x"}, "by: found 'x'"),
        ({"state": "nominal"}, "state: found 'nominal'"),
        ({"draws": 1}, "draws: found 1, expected at least 2"),
        ({"workers": 0}, "workers: found 0, expected at least 1"),
        ({"confidence": 2.0}, "confidence: found 2.0, expected a number between"),
        ({"yield_strength": -1.0}, "yield_strength: found -1.0, expected > 0 Pa"),
        ({"capability": True}, "capability: found no limits"),
        ({"contact_length": 0.1}, "contact_length: found together with clearance"),
        ({"limits": {"enrgy": 1.0}}, "limit enrgy: found a quantity"),
        ({"errors": None}, "neither --errors"),
    ],
)
def test_statistics_reject_an_argument_out_of_range(tip, normal, options, message):
    with pytest.raises(ff.BadInput, match=message):
        ff.statistics(tip, **{"errors": normal, "draws": 10, **options})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"errors": "translation"}, "found errors or interactive=True for a data set"),
        ({"kind": "tornado"}, "show: "),
        ({"quantities": ["enrgy"]}, "enrgy"),
    ],
)
def test_show_rejects_invalid_options_for_draws(tip, normal, options, message):
    found = ff.statistics(tip, normal, draws=4)
    with pytest.raises(ff.BadInput, match=message):
        ff.show(found, **options)


def test_show_rejects_other_files_and_data_set_options_for_a_robot(normal):
    with pytest.raises(ff.BadInput, match="normal.toml"):
        ff.show(normal)
    with pytest.raises(ff.BadInput, match="valid only for a data set"):
        ff.show(ff.load_robot("five_bar"), quantities=["energy"])
