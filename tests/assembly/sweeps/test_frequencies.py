"""Natural frequencies as quantities of sweeps."""

import pytest

from assembly.kinematics.posture import place_robot
from assembly.platform_stiffness.vibration import natural_modes
from assembly.robots import load_robot
from assembly.sweeps.maps import figure_of
from assembly.sweeps.request import SweepOptions, ask_sweep
from assembly.sweeps.sweep import sweep_in_memory
from forcefit.inputs.table import BadInput


def test_each_point_has_the_frequencies_of_its_posture():
    """A lighter, as stiff design is faster: omega falls as 1 / sqrt(density)."""
    rods = "density=2000,8000"
    options = SweepOptions(
        grid="tx=0:0.1:0.1,tz=-0.9",
        vary=[f"leg1.elbow.link.{rods}"],
        assumption="none",
        frequencies=3,
    )
    data = sweep_in_memory(ask_sweep("delta", options))
    assert data.frequency.dims[-1] == "mode"
    one = natural_modes(place_robot(load_robot("delta"), {"tx": 0.1, "tz": -0.9}), 3)
    assert one.frequencies.shape == (3,)
    light, heavy = data.frequency.isel({data.frequency.dims[0]: [0, 1]}).values
    assert (light >= heavy).all()
    assert (light[..., 0] > 0).all()
    titles = [axes.get_title() for axes in figure_of(data, {}).axes]
    assert "lowest natural frequency [Hz]" in titles


@pytest.mark.parametrize(
    ("robot", "count", "message"),
    [
        ("delta", 0, "--frequencies: found 0, expected 1 to 100"),
        ("irsbot2", 2, "found no mass that moves"),
    ],
)
def test_what_has_no_frequencies_is_refused(robot, count, message):
    with pytest.raises(BadInput, match=message):
        ask_sweep(
            robot,
            SweepOptions(grid="tx=0,tz=-0.5", assumption="none", frequencies=count),
        )
