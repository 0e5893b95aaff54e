"""The command ``forcefit assembly stiffness``: its contract with machines."""

import json

import numpy as np
import pytest

SLIDER = """
name = "slider"
platform = "tip"
[[frame]]
name = "slide"
parent = "base"
joint = "prismatic"
translation = [0.5, 0.0, 0.0]
link = { beam = { radius = 0.01 }, young = 7e10, poisson = 0.3 }
[[frame]]
name = "tip"
parent = "slide"
"""


def test_the_matrices_are_where_machines_expect_them(run):
    status, out, _ = run(
        "assembly", "stiffness", "orthoglide", "--pose", "tx=0.01,ty=0,tz=0",
        "--at", "0,0,0.05",
        "--json", "-",
    )  # fmt: skip
    answer = json.loads(out)
    assert status == 0
    assert answer["status"] == "ok"
    C, K = np.array(answer["compliance"]), np.array(answer["stiffness"])
    assert C.shape == K.shape == (6, 6)
    assert answer["free_motions"] == []
    np.testing.assert_allclose(answer["point"], [0.01, 0, 0.05], atol=1e-9)
    shares = answer["shares"]["tz"]
    assert sum([*shares["links"].values(), *shares["joints"].values()]) == (
        pytest.approx(1.0)
    )
    # the robot has clearances and no load: nothing is held
    (side,) = answer["in_contact"]
    assert len(side["free_motions"]) == 6
    np.testing.assert_array_equal(side["compliance"], np.full((6, 6), None))


def test_a_free_motion_is_null_and_exit_status_1(run, tmp_path):
    (tmp_path / "slider.toml").write_text(SLIDER)
    status, out, _ = run(
        "assembly", "stiffness", str(tmp_path / "slider.toml"), "--json", "-"
    )
    answer = json.loads(out)
    assert status == 1
    assert answer["status"] == "free motion"
    np.testing.assert_allclose(answer["free_motions"], [[0, 0, 0, 0, 0, 1]])
    assert answer["compliance"][5] == [None] * 6
    assert answer["compliance"][3][3] == pytest.approx(0.5 / (7e10 * np.pi * 1e-4))


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (["--at", "0,0"], "--at: found '0,0', expected three numbers"),
        (["--at", "0,nan,0"], "--at: found '0,nan,0', expected three numbers"),
        (["--length", "0"], "--length: found 0, expected a finite number > 0"),
        (["--load", "fy=x"], '--load: found "fy=x", expected NAME=NUMBER'),
    ],
)
def test_what_is_no_point_length_or_load_is_refused(run, option, message):
    status, out, err = run("assembly", "stiffness", "four_bar", *option)
    assert status == 2
    assert out == ""
    assert message in err


def test_the_chart_is_written(run, tmp_path):
    picture = tmp_path / "shares.png"
    status, out, _ = run(
        "assembly", "stiffness", "irsbot2", "--exact", "--load", "fz=-100",
        "-o", str(picture),
    )  # fmt: skip
    assert picture.stat().st_size > 1000
    assert "stiffness exact" in out
    assert status in {0, 1}
