"""Test the 3-D view of the robot on the report page of a diagnosis."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.diagnosis.figures import assembled, worst_robot, worst_row
from tests.planar_arm_for_tests import SIGMA, measured


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory):
    """Diagnosis of an arm with a compliant drive."""
    folder = tmp_path_factory.mktemp("soft") / "soft"
    return diagnose(measured(folder, seed=1, stiffness=(np.inf, 7e4)))


def test_robot_in_the_report_has_its_measured_pose(diagnosed):
    """The error is below five sigma, compared with 20 sigma before diagnosis."""
    row, name = worst_row(diagnosed)
    assert name == "position"
    aside = diagnosed.held.rows & ~diagnosed.outliers
    sizes = np.linalg.norm(np.nan_to_num(diagnosed.residual_before[:, 3:]), axis=1)
    assert aside[row]
    assert sizes[row] == sizes[aside].max()
    read = diagnosed.campaign.measured[row]
    known = np.isfinite(read)
    sigma = np.broadcast_to(SIGMA, 6)[known]
    off = (read - assembled(diagnosed, row).platform_screw)[known] / sigma
    assert np.abs(off).max() < 5
    assert np.abs(diagnosed.residual_before[row][known] / sigma).max() > 20
    drawn = worst_robot(diagnosed)
    assert f"Row {diagnosed.campaign.ids[row]}, held out" in drawn
    assert "drive compliance" in drawn


def test_report_has_no_view_of_the_robot_without_held_out_rows(diagnosed):
    no_rows = np.zeros(len(diagnosed.campaign), bool)
    none = replace(diagnosed, held=replace(diagnosed.held, folds=(no_rows,)))
    assert worst_row(none) == (-1, "")
    assert worst_robot(none) == ""
