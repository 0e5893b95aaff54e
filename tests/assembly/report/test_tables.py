"""Results as data sets and tables."""

import numpy as np
import pytest

import forcefit as ff
from forcefit import bound_pose_error, place_robot, solve_assembly, solve_exact
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
    """The sum is eq. (8) of the paper."""
    data = answer.to_xarray()
    parts = "geometric_error", "clearance_screw", "link_screw", "joint_screw"
    total = sum(data[name] for name in parts)
    screw = answer.linearisation.platform @ total.values.ravel()
    np.testing.assert_allclose(screw, data.platform_screw, rtol=1e-12)


def test_exact_data_set_has_the_variables_of_the_linear_data_set(answer):
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


LATERAL = 3 * 2e11 * np.pi * 1e-8 / 4 / 0.4**3  # [N/m] bending stiffness of the bar


def bar():
    """Return a round bar of length L = 0.4 m along x, clamped at its base."""
    beam = ff.BeamLink({"radius": 0.01}, 2e11, 0.3, 7850.0, theory="euler")
    tip = ff.Frame("tip", translation=[0.4, 0, 0], link=beam)
    return ff.place_robot(ff.Robot("bar", "tip", (tip,)))


def test_stiffness_data_set_of_a_bar_equals_handbook_values():
    """The stiffness is E A / L along the axis and 3 E I / L^3 across it."""
    tangent = ff.platform_stiffness(bar())
    data, table = tangent.to_xarray(), tangent.to_pandas()
    axial, lateral = 2e11 * np.pi * 1e-4 / 0.4, LATERAL
    stiffness = data["stiffness"].sel(wrench_component=["FX", "FY", "FZ"])
    np.testing.assert_allclose(stiffness, [axial, lateral, lateral], rtol=1e-9)
    slope = data["compliance"].sel(screw="RZ", wrench_component="FY")
    assert float(slope) == pytest.approx(1.5 / lateral / 0.4)
    product = data["stiffness_matrix"].values @ data["compliance"].values
    np.testing.assert_allclose(product, np.eye(6), atol=1e-9)
    assert list(table.index) == ["tip link"]
    np.testing.assert_allclose(table["share"], 1.0)
    assert data["stiffness"].attrs["units"] == "N m/rad, N/m"


def test_stiffness_table_of_many_points_equals_the_points_and_a_sweep():
    robot = ff.load_robot("hexapod")
    poses = [{"tx": x, "tz": 0.53} for x in (-0.05, 0.0, 0.05)]
    many = ff.platform_stiffness([ff.place_robot(robot, pose=p) for p in poses])
    data = many.to_xarray()
    swept = ff.sweep(robot, grid="tx=-0.05:0.05:0.05,tz=0.53", state="nominal",
                     assumption="none").squeeze()  # fmt: skip
    for name in ("stiffness", "compliance", "share", "stiffness_condition"):
        np.testing.assert_allclose(data[name], swept[name], rtol=1e-9, atol=1e-12)
        assert data[name].attrs["units"] == swept[name].attrs["units"]
        assert data[name].dims[1:] == swept[name].dims[1:]
    assert list(data["part"].values) == list(swept["part"].values)
    x = data["read_at"].sel(axis="x")
    np.testing.assert_allclose(x, [-0.05, 0, 0.05], atol=1e-9)
    one = many[1].to_xarray()
    np.testing.assert_allclose(one["stiffness"], data["stiffness"][1], rtol=1e-9)
    axial = many.to_pandas()["stiffness", "FZ"]
    np.testing.assert_array_equal(axial, data["stiffness"].sel(wrench_component="FZ"))


def test_modes_table_has_a_row_for_each_mode_and_shares_that_sum_to_one():
    modes = ff.natural_modes(bar(), 3)
    table = modes.to_pandas()
    assert list(table.index) == [1, 2, 3]
    np.testing.assert_array_equal(table["frequency", ""], modes.frequencies)
    np.testing.assert_allclose(table["share"].sum(axis=1), 1.0)
    assert table.attrs["units"]["frequency"] == "Hz"


def test_load_deflection_table_of_a_bar_obeys_hookes_law():
    table = ff.deflection_curve(bar(), 5, [-10, 0, 20]).to_pandas()
    np.testing.assert_array_equal(table["load", ""], [-10, 0, 20])
    np.testing.assert_allclose(table["deflection", ""], table["load", ""] / LATERAL)
    np.testing.assert_allclose(table["stiffness", ""], LATERAL)
    assert table.attrs["units"]["stiffness"] == "N/m"
