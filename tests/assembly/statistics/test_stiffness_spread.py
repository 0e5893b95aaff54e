"""Distribution of the platform stiffness for random errors."""

import json
from dataclasses import replace

import numpy as np
import pytest
import xarray

from forcefit import Clearance, Frame, Robot, load_robot, platform_stiffness
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.monte_carlo import run_draws
from forcefit.assembly.statistics.stiffness_spread import (
    draw_stiffnesses,
    stiffness_report,
    stiffness_spread_text,
)

ERRORS = """errors = [
    { frames = ["link_a", "link_b"], most = [2e-2, 2e-2, 2e-2, 2e-4, 2e-4, 2e-4] }
]"""


def spring(row, stiffness):
    K = np.diag([np.inf] * 6)
    K[row, row] = stiffness
    return K


def test_stiffness_of_two_springs_depends_on_contact():
    """The stiffness is 2 k if both springs are in contact, and k otherwise."""
    k, c = 1e5, 1e-4
    frames = (
        Frame("one", joint_stiffness=spring(3, k)),
        Frame("platform", "one"),
        Frame("two", joint_stiffness=spring(3, k)),
        Frame("bush", "two", clearance=Clearance(radial=0.0, axial=c, tilt=0.0),
              rotation=[0, np.pi / 2, 0]),
        Frame("end", "bush", rotation=[0, -np.pi / 2, 0]),
    )  # fmt: skip
    robot = Robot("bush", "platform", frames, (("platform", "end"),))
    errors = np.zeros((2, 5, 6))
    errors[:, 4, 3] = 2 * c, 0.5 * c
    spread, free = draw_stiffnesses(home_posture(robot), errors, "contact")
    np.testing.assert_allclose(spread[:, 3], [2 * k, k], rtol=1e-9)
    assert np.isnan(free).all()


@pytest.mark.parametrize("state", ["contact", "exact"])
def test_stiffness_of_a_draw_equals_single_solution(state):
    robot = load_robot("irsbot2")
    posture = place_robot(robot, {"tx": 0.1, "tz": -0.5})
    sources = tolerance_sources(robot, [2e-2] * 3 + [2e-4] * 3)
    load = (0.0, 0.0, 0.0, 0.0, 0.0, -100.0)
    data = run_draws(Experiment(posture, sources, 3, "least", margins=False, load=load,
                                stiffness=state), 2)  # fmt: skip
    values = sources.errors(sources.draw(0, 2, 3))
    for found, errors in zip(data["stiffness"].values, values, strict=True):
        forced = replace(posture, robot=robot.with_errors(errors))
        tangent = platform_stiffness(forced, state, load)
        expected = [tangent.along(axis)[0] for axis in np.eye(6)]
        np.testing.assert_allclose(found, expected, rtol=1e-6)
    assert np.ptp(data["stiffness"].values, axis=0).min() > 0.0


def test_stiffness_report_counts_draws_with_free_motions():
    values = np.full((10, 6), 2e6)
    values[:4, 5], values[4, 5], values[:, 2] = 0.0, np.nan, 0.02
    motions = np.full((10, 6, 6), np.nan)
    motions[:4, 0] = [0, 0, 0, 0, 0, 1.0]
    motions[3, 1] = [0, 0, 1.0, 0, 0.1234, 0]
    whole = stiffness_report(values, motions, "contact", 0.95)
    report, free = whole["axes"], whole["free_motions"]
    assert [one["draws"] for one in free] == [4, 1]
    np.testing.assert_array_equal(free[1]["screw"], [0, 0, 1, 0, 0.12, 0])
    assert "[0 0 0 0 0 1] [rad, m] in 4 draws" in stiffness_spread_text(whole)
    assert report["fz"]["draws"] == 9
    assert report["fz"]["free"]["probability"] == pytest.approx(4 / 9)
    assert report["fz"]["mean"]["value"] == report["fx"]["mean"]["value"] == 2e6
    # A small stiffness is not a free motion.
    assert report["mz"]["free"]["probability"] == 0.0
    assert report["mz"]["quantiles"]["0.5"]["value"] == pytest.approx(0.02)


def test_statistics_command_writes_the_stiffness_distribution(run, tmp_path):
    errors, file = tmp_path / "errors.toml", tmp_path / "draws.nc"
    errors.write_text(ERRORS)
    words = ["assembly", "statistics", "irsbot2", "--errors", errors, "--pose",
             "tx=0.1,tz=-0.5", "--draws", 20, "--no-margins", "--clearance", "least",
             "--state"]  # fmt: skip
    status, out, _ = run(*words, "contact", "-o", file, "--json", "-")
    axes = json.loads(out)["stiffness"]["axes"]
    assert status == 0
    assert set(axes) == {"mx", "my", "mz", "fx", "fy", "fz"}
    with xarray.open_dataset(file, engine="h5netcdf") as data:
        half = np.quantile(data["stiffness"].values[:, 5], 0.5)
    quantiles = axes["fz"]["quantiles"]
    assert quantiles["0.05"]["value"] <= half <= quantiles["0.95"]["value"]
    status, _, err = run(*words, "linear")
    assert status == 2
    assert '--state: found "linear"' in err


def test_infinite_stiffness_is_reported_as_rigid():
    """The platform is rigid along fx in all draws and along fy in one of four."""
    stiffnesses = np.full((4, 6), 2.0)
    stiffnesses[:, 3], stiffnesses[0, 4], stiffnesses[:, 5] = np.inf, np.inf, np.nan
    said = stiffness_report(stiffnesses, np.full((4, 6, 6), np.nan), "contact", 0.95)
    axes, lines = said["axes"], stiffness_spread_text(said).splitlines()
    assert axes["fx"]["rigid"]["probability"] == 1.0
    assert axes["fx"]["free"]["probability"] == 0.0
    assert "mean" not in axes["fx"]
    assert lines[4] == "  fx: no finite stiffness; rigid in 1"
    assert axes["fy"]["rigid"]["probability"] == 0.25
    assert axes["fy"]["mean"]["value"] == pytest.approx(2.0)
    assert axes["fz"] == {"unit": "N/m", "draws": 0}
