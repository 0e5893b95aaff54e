"""Results as data sets and tables: equal numbers, labels, units."""

import numpy as np
import pytest

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.sweeps.quantities import Question, variables
from forcefit.stiffness.screws import SCREW, WRENCH
from tests.robots_for_tests import NUMBERS, irsbot2_with


@pytest.fixture(scope="module")
def answer():
    robot = irsbot2_with(NUMBERS["cases"][0])
    return solve_assembly(place_robot(robot, pose={"tx": 0.1, "tz": -0.5}))


@pytest.fixture(scope="module")
def batches(answer):
    at = [answer.posture] * 3
    many = solve_assembly(at)
    return many, zone_margin(at), bound_pose_error(many)


def test_assembly_data_set_has_labelled_frames_and_equal_numbers(answer):
    data = answer.to_xarray()
    assert data.sizes == {"frame": 42, "screw": 6, "wrench_component": 6, "closure": 5}
    assert float(data.energy) == answer.energy
    robot = answer.posture.robot
    here = data.sel(frame="leg1.link_a", wrench_component="FZ")
    assert float(here.wrench) == answer.wrenches[robot.index("leg1.link_a"), 5]
    assert float(data.tx) == pytest.approx(0.1)
    assert data.platform_screw.sel(screw="TX") == answer.platform_screw[3]
    np.testing.assert_array_equal(data.closure_wrench, answer.closure_wrenches)


def test_screws_of_the_data_set_sum_to_the_platform_screw(answer):
    """Eq. (8) with labels: errors, clearances, links and joints."""
    data = answer.to_xarray()
    total = (
        data.geometric_error + data.clearance_screw + data.link_screw + data.joint_screw
    )
    screw = answer.linearisation.platform @ total.values.ravel()
    np.testing.assert_allclose(screw, data.platform_screw, rtol=1e-12)


def test_exact_data_set_has_the_names_of_the_linear_one(answer):
    linear, exact = answer.to_xarray(), solve_exact(answer.posture).to_xarray()
    assert {*linear.variables} == {*exact.variables}
    assert float(exact.energy) < float(linear.energy)


def test_every_variable_of_a_data_set_has_a_unit_and_a_long_name(answer, batches):
    for data in (answer.to_xarray(), *(one.to_xarray() for one in batches)):
        for name, variable in data.data_vars.items():
            assert set(variable.attrs) == {"units", "long_name"}, name


def test_units_and_dimensions_of_data_sets_equal_those_of_sweeps(answer, batches):
    asked = variables(Question(answer.posture.robot, assumption="frozen"))
    seen = set()
    for one in batches:
        for name, variable in one.to_xarray().data_vars.items():
            if name in asked:
                seen.add(name)
                assert variable.attrs["units"] == asked[name].quantity.unit, name
                assert variable.dims == ("point", *asked[name].dims), name
    assert seen >= {"energy", "margin", "platform_screw", "rotation_error"}


def test_assembly_table_has_a_row_for_each_frame(answer):
    table = answer.to_pandas()
    assert list(table.index) == [f.name for f in answer.posture.robot.frames]
    np.testing.assert_array_equal(table["wrench"][list(WRENCH)], answer.wrenches)
    np.testing.assert_array_equal(table["link_screw"][list(SCREW)], answer.link_screws)
    assert table.attrs["units"]["wrench"] == "N m, N"


def test_table_of_many_points_has_a_row_for_each_point(batches):
    energies, margins, errors = (one.to_pandas() for one in batches)
    assert list(energies.index) == [0, 1, 2]
    np.testing.assert_array_equal(energies["energy", ""], batches[0].energy)
    np.testing.assert_array_equal(margins["margin", ""], batches[1].margin)
    upper = errors["translation_error", "upper"]
    np.testing.assert_array_equal(upper, batches[2].translation_error[:, 1])
    assert set(errors["status", ""]) == {"ok"}
