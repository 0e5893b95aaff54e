"""Platform stiffness and natural frequencies in sweeps."""

import numpy as np
import pytest

from forcefit import BadInput, natural_modes, place_robot, platform_stiffness, sweep
from forcefit.assembly.platform_stiffness.linear_tangent import without_clearance
from forcefit.assembly.robots import load_robot
from forcefit.assembly.sweeps.maps import figure_of
from forcefit.assembly.sweeps.parameters import load_design
from forcefit.assembly.sweeps.request import SweepOptions, ask_sweep
from forcefit.assembly.sweeps.sweep import sweep_in_memory


def test_swept_stiffness_equals_single_solutions():
    data = sweep("irsbot2", grid="tx=-0.1:0.1:0.1,tz=-0.5:-0.4:0.1",
                 assumption="none", state="nominal")  # fmt: skip
    robot = load_robot("irsbot2")
    one = without_clearance(place_robot(robot, {"tx": 0.1, "tz": -0.4}))
    there = data.sel(tx=0.1, tz=-0.4, method="nearest")
    assert_same(there.compliance.values, one.compliance, 1e-9)
    np.testing.assert_allclose(
        there.eigen_stiffness.values, one.eigen.values, rtol=1e-8
    )
    np.testing.assert_allclose(data.share.sum("part"), 1.0)
    link = there.share.sel(part="leg1.link_a link", wrench_component="FZ")
    assert float(link) == pytest.approx(
        one.shares([0, 0, 0, 0, 0, 1])["leg1.link_a", "link"], abs=1e-9
    )
    titles = [axes.get_title() for axes in figure_of(data).axes]
    assert "softest eigen-stiffness [N/um]" in titles


LOAD = (0.0, 0.0, 0.0, 0.0, 0.0, -300.0)


def assert_same(found, expected, tol):
    """Check that compliances agree relative to the root of the diagonal."""
    size = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(found / np.outer(size, size),
                               expected / np.outer(size, size), atol=tol)  # fmt: skip


@pytest.mark.parametrize("state", ["contact", "exact"])
def test_swept_tangent_includes_errors_load_and_clearances(state):
    """The tangent stiffness depends on the errors of the design and on the load."""
    options = SweepOptions(
        grid="tx=0.1,tz=-0.5", assumption="none", state=state, load=LOAD,
        vary=["leg1.link_a.geometric_error.rx=0,0.02"],
    )  # fmt: skip
    data = sweep_in_memory(ask_sweep("irsbot2", options)).squeeze()
    robot = load_robot("irsbot2")
    errors = np.zeros((len(robot.frames), 6))
    errors[robot.index("leg1.link_a"), 0] = 0.02
    posture = place_robot(robot.with_errors(errors), {"tx": 0.1, "tz": -0.5})
    expected = platform_stiffness(posture, state, LOAD, side="unloading")
    assert_same(data.compliance.values[1], expected.compliance, 1e-6)
    np.testing.assert_allclose(data.share.sum("part"), 1.0)
    assert np.ptp(data.stiffness.values, axis=0).max() > 0.0
    assert state != "exact" or "internal forces and loads" in data.part.values


def test_swept_tangent_reports_free_motions():
    data = sweep("irsbot2", grid="tx=0,tz=-0.5", assumption="none", state="contact",
                 load=LOAD)  # fmt: skip
    assert "the platform moves freely along" in str(data.reason.values.ravel()[0])
    assert float(data.stiffness.sel(wrench_component="FY").squeeze()) == 0.0


def test_swept_frequencies_equal_single_solutions():
    path, pose = "leg1.elbow.link.density", {"tx": 0.1, "tz": -0.9}
    data = sweep(
        "delta", grid="tx=0:0.1:0.1,tz=-0.9", assumption="none", frequencies=3,
        vary=[f"{path}=2000,8000"],
    )  # fmt: skip
    for density in (2000.0, 8000.0):
        robot = load_design("delta").robot({path: density})
        expected = natural_modes(place_robot(robot, pose), 3).frequencies
        found = data.frequency.sel(pose | {path: density}, method="nearest")
        np.testing.assert_allclose(found, expected, rtol=1e-9)
    titles = [axes.get_title() for axes in figure_of(data, {}).axes]
    assert "lowest natural frequency [Hz]" in titles


@pytest.mark.parametrize(
    ("robot", "option", "message"),
    [
        ("delta", {"frequencies": 0}, "--frequencies: found 0, expected 1 to 100"),
        ("irsbot2", {"frequencies": 2}, "found no moving mass"),
        ("irsbot2", {"state": "exakt"}, '--state: found "exakt"'),
    ],
)
def test_invalid_frequencies_and_states_are_rejected(robot, option, message):
    with pytest.raises(BadInput, match=message):
        sweep(robot, grid="tx=0,tz=-0.5", assumption="none", **option)


ARM = """
platform = "tip"
[[frame]]
name = "drive"
parent = "base"
joint = "revolute"
actuated = true
[[frame]]
name = "tip"
parent = "drive"
translation = [0.4, 0, 0]
[[effect]]
name = "drive_compliance"
parameters = { drive = 3e4 }
[[effect]]
name = "base_compliance"
parameters = { "stiffness.rz" = 1e4 }
"""


@pytest.mark.parametrize("state", ["nominal", "contact", "exact"])
def test_swept_stiffness_includes_springs_of_effects(tmp_path, state):
    """Springs in series: 1/3e4 + 1/1e4 rad/(N m), of which 1/4 in the drive."""
    (tmp_path / "arm.toml").write_text(ARM)
    data = sweep(tmp_path / "arm.toml", grid="q.drive=0:0.2:0.1", assumption="none",
                 state=state, load=[0, 0, 10.0, 0, 0, 0])  # fmt: skip
    np.testing.assert_allclose(data.compliance[:, 2, 2], 1 / 3e4 + 1 / 1e4, rtol=1e-6)
    under_mz = data.share.sel(wrench_component="MZ")
    for part, share in (("drive joint", 0.25), ("foundation joint", 0.75)):
        np.testing.assert_allclose(under_mz.sel(part=part), share, rtol=1e-6)


PIN = """
platform = "tip"
[[frame]]
name = "drive"
parent = "base"
joint = "revolute"
actuated = true
[[frame]]
name = "pin"
parent = "drive"
joint_stiffness = [1e3, 1e3, 1e3, 1e6, 1e6, 1e6]
clearance = { radial = 0.0 }
[[frame]]
name = "tip"
parent = "pin"
"""


def test_swept_stiffness_accepts_clearance_that_is_zero_in_the_file(tmp_path):
    """100 N against a bound of radius 0.1 mm: 1e6 N/m tangential to the bound."""
    (tmp_path / "pin.toml").write_text(PIN)
    data = sweep(tmp_path / "pin.toml", grid="q.drive=0", assumption="none",
                 state="contact", load=[0, 0, 0, 100.0, 0, 0],
                 vary=["pin.clearance.radial=0,1e-4"]).squeeze()  # fmt: skip
    np.testing.assert_allclose(data.compliance[:, 4, 4], [1e-6, 2e-6], rtol=1e-6)
    under_fy = data.share.sel(part="pin clearance", wrench_component="FY")
    np.testing.assert_allclose(under_fy, [0.0, 0.5], atol=1e-6)
