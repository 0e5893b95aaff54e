"""Command ``forcefit assembly stiffness``: JSON keys and exit statuses."""

import json

import numpy as np
import pytest

from forcefit.assembly.sweeps.request import SweepOptions, ask_sweep
from forcefit.assembly.sweeps.sweep import sweep_in_memory

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


def test_stiffness_results_include_compliance_and_stiffness(run):
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
    # without a load, the platform can move within the clearances
    (side,) = answer["contact"]
    assert len(side["free_motions"]) == 6
    np.testing.assert_array_equal(side["compliance"], np.full((6, 6), None))


def test_free_motion_has_null_compliance_and_exit_status_1(run, tmp_path):
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


@pytest.mark.parametrize("words", [
    ["stiffness", "--state", "exact", "--load", "fz=5"],
    ["deflection", "--along", "fz=0:5:5"],
    ["deflection", "--along", "fz=0:5:5", "--state", "exact"],
    ["deflection", "--along", "fz=0:5:5", "--follow"],
    ["frequencies", "--state", "exact", "--load", "fz=5"],
])  # fmt: skip
def test_load_along_a_free_motion_has_exit_status_1(run, tmp_path, words):
    (tmp_path / "slider.toml").write_text(SLIDER)
    status, out, err = run(
        "assembly", words[0], str(tmp_path / "slider.toml"), *words[1:]
    )
    assert status == 1
    assert err == ""
    assert "it moves slide tz; the platform moves along [0 0 0 0 0 1] [rad, m]" in out


def test_sweep_names_the_free_motion(tmp_path):
    """The stiffness in the other directions is computed."""
    (tmp_path / "slider.toml").write_text(SLIDER)
    asked = ask_sweep(
        str(tmp_path / "slider.toml"),
        SweepOptions(grid="tz=0:0:1", assumption="none", state="nominal"),
    )
    data = sweep_in_memory(asked).squeeze()
    assert str(data.reason.values) == (
        "the platform moves freely along [0 0 0 0 0 1] [rad, m]"
    )
    assert float(data.stiffness.sel(wrench_component="FZ")) == 0.0
    stretched = 7e10 * np.pi * 1e-4 / 0.5
    assert float(data.stiffness.sel(wrench_component="FX")) == pytest.approx(stretched)


def test_stiffness_command_writes_a_figure(run, tmp_path):
    picture = tmp_path / "shares.png"
    status, out, _ = run(
        "assembly", "stiffness", "irsbot2", "--state", "exact", "--load", "fz=-100",
        "--figure", str(picture),
    )  # fmt: skip
    assert picture.stat().st_size > 1000
    assert "state exact" in " ".join(out.split())
    assert status in {0, 1}


def test_stiffness_along_tz_equals_that_of_the_axis(run):
    """The values along tz equal those of this axis for a vector of any length."""
    status, out, _ = run(
        "assembly", "stiffness", "orthoglide", "--along", "tz=-2", "--json", "-"
    )
    answer = json.loads(out)
    assert status == 0
    along = answer["direction"]
    assert along["direction"] == [0, 0, 0, 0, 0, -1]
    assert along["free"] == pytest.approx(answer["along"]["tz"]["free"])
    assert along["blocked"] == pytest.approx(answer["along"]["tz"]["blocked"])
    assert along["shares"] == answer["shares"]["tz"]


@pytest.mark.slow
def test_load_without_an_equilibrium_has_exit_status_1(run):
    words = ["--state", "exact", "--load", "fx=1e9", "--json", "-"]
    status, out, _ = run("assembly", "stiffness", "four_bar", *words)
    answer = json.loads(out)
    assert status == 1
    assert answer["status"] == "solver failed"
    assert "force residual" in answer["reason"]


def test_stiffness_reports_a_platform_far_from_its_nominal_pose(run):
    """A load of 10 MN moves the platform from below the base to above the base."""
    for load, far in (("fz=1e7", True), ("fz=-300", False)):
        words = ["--state", "exact", "--load", load, "--json", "-"]
        _, out, _ = run("assembly", "stiffness", "irsbot2", *words)
        found = json.loads(out)
        assert (found["point"][2] > 0) == far
        assert len(found["remarks"]) == far
