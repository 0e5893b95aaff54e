"""Natural frequencies as quantities of sweeps."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.platform_stiffness.vibration import natural_modes
from forcefit.assembly.sweeps.maps import figure_of
from forcefit.assembly.sweeps.parameters import load_design
from forcefit.assembly.sweeps.robot_sweep import sweep
from forcefit.inputs.table import BadInput


def test_swept_frequencies_equal_those_of_single_postures():
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
    ("robot", "count", "message"),
    [
        ("delta", 0, "--frequencies: found 0, expected 1 to 100"),
        ("irsbot2", 2, "found no moving mass"),
    ],
)
def test_sweep_of_frequencies_without_mass_is_refused(robot, count, message):
    with pytest.raises(BadInput, match=message):
        sweep(robot, grid="tx=0,tz=-0.5", assumption="none", frequencies=count)
