"""Results of ``assembly stiffness`` and charts of contributions."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Frame, MatrixLink, Robot
from forcefit.assembly.report.platform_stiffness import (
    DIRECTIONS,
    stiffness_of,
    stiffness_text,
)
from forcefit.assembly.report.share_pictures import plot_shares, share_chart
from forcefit.page.charts import GREY
from tests.pages_for_tests import parse


def test_stiffness_with_a_free_motion_has_finite_other_entries():
    slide = Frame("slide", joint="prismatic", link=MatrixLink(np.eye(6)))
    tip = Frame("tip", "slide")
    results = stiffness_of(home_posture(Robot("slider", "tip", (slide, tip))))
    assert results["status"] == "free motion"
    np.testing.assert_allclose(results["free_motions"], [[0, 0, 0, 0, 0, 1]])
    C = np.array(results["compliance"])
    assert np.isnan(C[5]).all()
    np.testing.assert_allclose(C[:5, :5], np.eye(5), atol=1e-12)
    said = " ".join(stiffness_text(results).split())
    assert "free motion 1 [0 0 0 0 0 1]" in said


def test_load_without_resistance_is_reported_as_no_equilibrium():
    slide = Frame("slide", joint="prismatic", link=MatrixLink(np.eye(6)))
    posture = home_posture(Robot("slider", "tip", (slide, Frame("tip", "slide"))))
    results = stiffness_of(posture, [0, 0, 0, 0, 0, 1.0], state="exact")
    assert results["status"] == "no equilibrium"
    assert "no equilibrium" in stiffness_text(results)


def shares(parts):
    """Return equal contributions of links along every axis."""
    one = {f"part{k}": 1.0 / parts for k in range(parts)}
    return {name: {"links": dict(one), "joints": {}} for name in DIRECTIONS}


@pytest.mark.parametrize(("parts", "others"), [(5, 0), (20, 8)])
def test_contributions_in_the_chart_sum_to_one(parts, others):
    (spec,) = parse(share_chart(shares(parts), "")).figures
    heights = {t["name"]: t["y"] for t in spec["traces"]}
    np.testing.assert_allclose(sum(np.array(v) for v in heights.values()), 1.0)
    grey = [t for t in spec["traces"] if t["marker"]["color"] == GREY]
    assert [t["name"] for t in grey] == ([f"{others} others"] if others else [])
    assert all(one["y"] == pytest.approx([others / parts] * 6) for one in grey)


def test_plot_shows_the_sum_of_small_contributions_in_grey():
    figure = plot_shares({"robot": "r", "shares": shares(20)})
    bars = {c.get_label(): c.patches[0] for c in figure.axes[0].containers}
    spread = {name: np.ptp(p.get_facecolor()[:3]) for name, p in bars.items()}
    assert [name for name, size in spread.items() if size < 0.1] == ["8 others"]
