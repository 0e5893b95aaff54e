"""K_C as quantities of sweeps, over postures and designs, and on maps."""

import numpy as np
import pytest

from assembly.kinematics.posture import place_robot
from assembly.platform_stiffness.linear_tangent import without_clearance
from assembly.robots import load_robot
from assembly.sweeps.maps import figure_of
from assembly.sweeps.request import SweepOptions, ask_sweep
from assembly.sweeps.sweep import sweep_in_memory


def test_each_point_has_the_stiffness_of_its_posture():
    data = sweep_in_memory(
        ask_sweep(
            "irsbot2",
            SweepOptions(
                grid="tx=-0.1:0.1:0.1,tz=-0.5:-0.4:0.1", reading="none", stiffness=True
            ),
        )
    )
    robot = load_robot("irsbot2")
    one = without_clearance(place_robot(robot, {"tx": 0.1, "tz": -0.4}))
    there = data.sel(tx=0.1, tz=-0.4, method="nearest")
    size = np.sqrt(np.diag(one.compliance))
    np.testing.assert_allclose(
        there.compliance.values / np.outer(size, size),
        one.compliance / np.outer(size, size), atol=1e-9,
    )  # fmt: skip
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


def test_a_thicker_link_is_stiffer_in_a_sweep_of_designs():
    """Bending stiffness of a round bar grows with the radius to the fourth."""
    data = sweep_in_memory(
        ask_sweep(
            "irsbot2",
            SweepOptions(
                grid="tx=0,tz=-0.5",
                vary=["link_a.link.beam.radius=0.03,0.04,0.05"],
                reading="none",
                stiffness=True,
            ),
        )
    )
    stiffness = data.stiffness.sel(wrench_component="FY").values.ravel()
    assert (np.diff(stiffness) > 0).all()
