"""Results at the points of a sweep."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from forcefit import BeamLink, bound_pose_error, load_robot, solve_assembly, solve_exact
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.error_distributions import read_sources
from forcefit.assembly.sweeps import points
from forcefit.assembly.sweeps.maps import figure_of
from forcefit.assembly.sweeps.parameters import load_design
from forcefit.assembly.sweeps.plan import Sweep
from forcefit.assembly.sweeps.quantities import Question
from forcefit.assembly.sweeps.request import SweepOptions, ask_sweep, summary_of
from forcefit.assembly.sweeps.robot_sweep import sweep
from forcefit.assembly.sweeps.selection import BY_CLEARANCE
from forcefit.assembly.sweeps.sweep import sweep_in_memory, sweep_poses
from forcefit.assembly.sweeps.targets import grid_targets, parse_grid
from forcefit.inputs.table import BadInput
from tests.linkages_for_tests import SLIDER_CRANK, slider_crank
from tests.robots_for_tests import NUMBERS, irsbot2_with
from tests.three_upu_for_tests import BASE, HEIGHT, PLATFORM, three_upu

GRID = "tx=-0.2:0.2:0.2,tz=-0.5:-0.4:0.1"
ERRORS = """errors = [
    { frames = ["elbow", "arm"], most = [1e-4, 1e-4, 1e-4, 1e-5, 1e-5, 1e-5] }
]"""


@pytest.fixture(scope="module")
def robot():
    return irsbot2_with(NUMBERS["cases"][0])


@pytest.fixture(scope="module")
def data(robot):
    """Return a sweep with all quantities at six postures."""
    axes = parse_grid(GRID)
    question = Question(
        robot, None, (), tuple(axes), assumption="free", clearance_only=True,
        wrenches=("leg1.link_a", "leg2.elbow_b_first"), linearisation=True,
    )  # fmt: skip
    return sweep_in_memory(Sweep(question, grid_targets(axes)))


def test_swept_wrenches_equal_single_solutions(robot, data):
    """Energies are certified to 1e-8, so wrenches agree to about 1e-4."""
    answer = solve_assembly(place_robot(robot, pose={"tx": 0.2, "tz": -0.4}))
    found = data.wrench.sel(tx=0.2, tz=-0.4, method="nearest")
    assert found.dims == ("frame", "wrench_component")
    for name in data.frame.values:
        expected = answer.wrenches[robot.index(str(name))].reshape(2, 3)
        difference = found.sel(frame=name).values.reshape(2, 3) - expected
        assert np.linalg.norm(difference, axis=1) == pytest.approx(
            0.0, abs=1e-6 * np.abs(expected).max()
        )


def test_swept_bounds_and_exact_solutions_equal_single_solutions(robot, data):
    posture = place_robot(robot, pose={"tx": 0.2, "tz": -0.4})
    there = data.sel(tx=0.2, tz=-0.4, method="nearest")
    bounds = bound_pose_error(solve_assembly(posture), "free")
    assert there.rotation_error.values == pytest.approx(bounds.rotation_error, abs=2e-6)
    gap = solve_exact(posture).linearisation_error
    size = np.linalg.norm(gap.translation)
    assert float(there.linearisation_translation) == pytest.approx(size, rel=1e-6)
    assert float(there.linearisation_energy) == pytest.approx(gap.relative_energy)


def test_pose_error_bounds_of_irsbot2_are_symmetric(data):
    """Bounds at x and -x agree within their gap of 1e-6."""
    for name in ("rotation_error_clearance", "translation_error_clearance"):
        values = data[name].sel(bound="upper").values
        assert values == pytest.approx(values[::-1], abs=2e-6)
        assert values == pytest.approx(data[name].sel(bound="lower").values, abs=2e-6)
    assert (data.rotation_error_clearance < data.rotation_error).all()


def test_sweep_of_a_design_is_bit_identical_to_that_of_its_robot():
    path = "link_a.link.beam.radius"
    data = sweep("irsbot2", grid=GRID, vary=[f"{path}=0.03,0.05"], assumption="none")
    assert data.energy.dims == (path, "tx", "tz")
    assert data[path].attrs["units"] == "m"
    one = sweep_poses(load_design("irsbot2").robot({path: 0.05}), parse_grid(GRID))
    there = data.sel({path: 0.05}, method="nearest")
    for name in ("margin", "energy", "platform_screw", "singular_distance"):
        assert np.array_equal(there[name], one[name], equal_nan=True), name


def test_swept_draws_are_bit_identical_to_single_robots(tmp_path):
    path = tmp_path / "errors.toml"
    path.write_text(ERRORS)
    grid = "tx=0:0.02:0.02,ty=0.14"
    data = sweep("five_bar", grid=grid, errors=path, draws=3, seed=11)
    assert data.energy.dims == ("tx", "ty", "draw")
    robot = load_robot("five_bar")
    sources = read_sources(path, robot)
    errors = sources.errors(sources.draw(0, 3, 11))
    for i in range(3):
        one = sweep_poses(robot.with_errors(errors[i]), parse_grid(grid),
                          assumption="frozen")  # fmt: skip
        there = data.isel(draw=i)
        for name in ("margin", "margin_free", "energy", "rotation_error"):
            assert np.array_equal(there[name], one[name], equal_nan=True), name


def test_list_and_grid_of_the_same_postures_have_equal_energies(robot, tmp_path):
    grid = sweep_poses(robot, parse_grid(GRID))
    pairs = product(grid.tx.values.tolist(), grid.tz.values.tolist())
    rows = [f"{a!r},{b!r}" for a, b in pairs]
    (tmp_path / "path.csv").write_text("\n".join(["pose.tx,pose.tz", *rows]) + "\n")
    found = sweep(robot, poses=tmp_path / "path.csv", assumption="none")
    assert found.energy.dims == ("posture",)
    assert found.tz.dims == ("posture",)
    assert np.array_equal(found.energy.values, grid.energy.values.ravel())
    assert len(figure_of(found).axes) == 6


def test_design_whose_loops_cannot_close_has_status_invalid_robot():
    path = "leg1.elbow_a.translation.y"
    y = float(load_robot("irsbot2").frame("leg1.elbow_a").translation[1])
    data = sweep("irsbot2", grid="tx=0,tz=-0.5:-0.4:0.1", vary=[f"{path}={y!r},0.4"],
                 assumption="none").squeeze()  # fmt: skip
    assert data.status.values.tolist() == [["ok", "ok"], ["invalid robot"] * 2]
    assert "is open in the home pose" in data.reason.values[1, 0]
    assert np.isnan(data.energy.values[1]).all()
    assert summary_of(data)["status"] == {"invalid robot": 2, "ok": 2}


def test_linear_algebra_error_affects_only_its_point(robot, monkeypatch):
    """An error is raised at the third of five postures."""
    solve, axes = points.solve_assembly, parse_grid("tx=-0.2:0.2:0.1,tz=-0.5")
    expected = sweep_poses(robot, axes)
    bad = place_robot(robot, pose={"tx": 0.0, "tz": -0.5}).platform[:3, 3]

    def breaks(postures, errors):
        at = postures.platform[:, :3, 3]
        if np.any(np.linalg.norm(at - bad, axis=1) < 1e-6):
            raise np.linalg.LinAlgError("SVD did not converge")
        return solve(postures, errors=errors)

    monkeypatch.setattr(points, "solve_assembly", breaks)
    data = sweep_poses(robot, axes).squeeze()
    assert data.status.values.tolist() == ["ok", "ok", "solver failed", "ok", "ok"]
    assert data.reason.values[2] == "SVD did not converge"
    others = [0, 1, 3, 4]
    found = data.energy.values[others]
    assert np.array_equal(found, expected.energy.values.ravel()[others])
    assert np.isnan(data.energy.values[2])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "sweep: expected exactly one of --grid and --poses"),
        ({"grid": "tx=0", "assumption": "fozen"},
         '--assumption: found "fozen"; did you'),
        ({"grid": "tx=0", "vary": ["link_a.link.beam.radius"]},
         '--vary: found "link_a.link.beam.radius", expected PATH=VALUE,..'),
        ({"grid": "tx=0", "vary": ["link_a.link.beam.radius=0.03,-1"]},
         'irsbot2: frame "leg1.link_a".link.beam.radius: found -1.0, expected a'),
        ({"grid": "tx=0", "vary": ["link_a.link.beam.radius=0.03,0.03"]},
         "--vary link_a.link.beam.radius: found the same value twice"),
        ({"grid": "tx=0", "vary": ["link_a.link.beam.radius=0.03",
                                   "leg1.link_a.link.beam.radius=0.04"]},
         "leg1.link_a.link.beam.radius is varied twice"),
        ({"grid": "tx=0", "draws": 3}, "sweep: found only one of --errors and --draws"),
        ({"grid": "tx=0", "wrench_of": ["leg1.link_q"]}, 'no frame "leg1.link_q"'),
        ({"grid": "tx=0", "near": -1.0}, "--near: found -1, expected a number from 0"),
        ({"grid": "tx=0:1:1e-5,tz=0:1:0.1", "vary": ["tip.mass=1:100:1"]},
         "sweep: found 110001100 points, expected at most 10000000"),
    ],
)  # fmt: skip
def test_invalid_sweep_options_are_rejected_with_one_message(options, message):
    with pytest.raises(BadInput) as error:
        ask_sweep("irsbot2", SweepOptions(**options))
    assert message in str(error.value)


def test_figures_require_only_the_data_set(tmp_path):
    path = tmp_path / "errors.toml"
    path.write_text(ERRORS)
    data = sweep(
        "five_bar", grid="tx=-0.02:0.02:0.02,ty=0.12:0.14:0.02", errors=path, draws=3,
        near=0.6, quantities=["default", *BY_CLEARANCE],
    )  # fmt: skip
    figure = figure_of(data)
    assert "median of 3 draws" in {t.get_text() for t in figure.texts}
    panel = next(a for a in figure.axes if "energy" in a.get_title())
    shown = np.ma.filled(panel.collections[0].get_array(), np.nan)
    expected = data.energy.median("draw").transpose("ty", "tx").values
    assert shown.reshape(expected.shape) == pytest.approx(expected, nan_ok=True)
    crosses = panel.lines[0].get_xydata()
    near = data.near_singularity.isel(draw=0) != ""
    assert len(crosses) == int(near.sum())
    one = figure_of(data, {"draw": 1, "tx": 0.0})
    assert [a.get_xlabel() for a in one.axes] == ["ty [m]"] * 6
    with pytest.raises(BadInput, match='--at: no axis "tz"'):
        figure_of(data, {"tz": 1.0})
    with pytest.raises(BadInput, match="found a single point"):
        figure_of(data, {"draw": 1, "tx": 0.0, "ty": 0.12})


def test_singular_point_of_a_sweep_has_status_singular():
    """The 3-UPU robot is singular above its centre."""
    robot = three_upu(seed=1)
    data = sweep_poses(robot, parse_grid("tx=-0.02:0.02:0.02,ty=0,tz=0.45"))
    assert data["status"].values.ravel().tolist() == ["ok", "singular", "ok"]
    assert np.isnan(data["energy"].values.ravel()).tolist() == [False, True, False]
    length = data["joint_coordinate"].sel(joint="leg1.slide").values.ravel()
    expected = np.hypot(BASE - PLATFORM - np.array([-0.02, 0.0, 0.02]), HEIGHT)
    assert length == pytest.approx(expected, abs=1e-9)


def test_postures_beyond_a_singularity_have_a_status():
    """The distal arms of the five-bar robot are collinear at a distance of 84.85 mm."""
    data = sweep_poses(load_robot("five_bar"), parse_grid("tx=0,ty=0.08:0.09:0.01"))
    assert data["status"].values.ravel().tolist() == ["beyond_singularity", "ok"]
    reason = str(data["reason"].values.ravel()[0])
    assert reason == "not connected to home without passing a singularity"
    assert np.isfinite(data["energy"].values).all()


def test_postures_beyond_joint_limits_have_a_status():
    """The x drive of the orthoglide has the coordinate r_x = p_x - L."""
    robot = load_robot("orthoglide")
    home = home_posture(robot).coordinates[robot.index("x.slide")]
    limits = {"x.slide": (home - 0.05, home + 0.02)}
    frames = tuple(replace(f, limits=limits.get(f.name)) for f in robot.frames)
    x = np.array([-0.051, -0.05, 0.0, 0.02, 0.021])
    axes = {"tx": x, "ty": np.zeros(1), "tz": np.zeros(1)}
    data = sweep_poses(replace(robot, frames=frames), axes)
    moved = data["joint_coordinate"].sel(joint="x.slide").values.ravel() - home
    assert moved == pytest.approx(x, abs=1e-9)
    beyond = ["beyond_limits", "ok", "ok", "ok", "beyond_limits"]
    assert data["status"].values.ravel().tolist() == beyond
    assert str(data["reason"].values.ravel()[0]).startswith("x.slide at ")


def test_point_with_invalid_linearisation_has_status_singular():
    """A short rod near its dead centre has elastic energy only in the exact
    solution.
    """
    robot = slider_crank(0.3, BeamLink({"radius": 0.01}, 70e9, 0.33), error=-2e-4)
    reach = sum(SLIDER_CRANK)
    targets = grid_targets({"q.slide": np.array([reach - 1e-5, reach - 0.02])})
    question = Question(robot, components=targets.names, linearisation=True)
    data = sweep_in_memory(Sweep(question, targets))
    assert data["status"].values.tolist() == ["singular", "ok"]
    assert "its energy is wrong by 100 %" in str(data["reason"].values[0])
