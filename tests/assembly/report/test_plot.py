"""3D plots and animations of robots."""

import numpy as np
import pytest
from PIL import Image

from forcefit import Frame, Robot, load_robot, solve_assembly, write_robot
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear import energy
from forcefit.assembly.report import error_body
from forcefit.assembly.report.plot import displaced_bodies, robot_plotter
from forcefit.assembly.report.plot_closing import closing_gaps
from tests.robots_for_tests import NUMBERS, irsbot2_with


def _assembly():
    robot = irsbot2_with(NUMBERS["cases"][0])
    return solve_assembly(place_robot(robot, pose={"tx": 0.1, "tz": -0.5}))


def test_both_frames_of_a_closure_have_the_same_displacement():
    """The displacements are computed without the closure equations (16)-(20)."""
    answer = _assembly()
    robot = answer.posture.robot
    screws = displaced_bodies(answer).end_screws
    for a, b in robot.closures:
        gap = screws[robot.index(a)] - screws[robot.index(b)]
        assert np.abs(gap).max() < 1e-12
    tip = screws[robot.index(robot.platform)]
    assert np.abs(tip - answer.platform_screw).max() < 1e-13


@pytest.mark.parametrize("name", ["delta", "hexapod", "orthoglide", "arm6"])
def test_robot_fits_into_the_plot_window(name):
    """The robot fills more than half of the window, without its edges."""
    answer = solve_assembly(home_posture(load_robot(name)))
    plotter = robot_plotter(answer, exaggeration=1)
    plotter.remove_actor("caption")
    plotter.hide_axes()
    pixels = plotter.screenshot(return_img=True).astype(int)
    plotter.close()
    drawn = np.abs(pixels - pixels[0, 0]).max(axis=2) > 8
    rows, columns = (np.flatnonzero(drawn.any(axis=k)) for k in (1, 0))
    height, width = drawn.shape
    free = (rows[0], height - 1 - rows[-1], columns[0], width - 1 - columns[-1])
    assert min(free) >= 10
    assert np.ptp(rows) > height / 2 or np.ptp(columns) > width / 2


def test_picture_shows_the_axes_of_driven_and_passive_joints():
    plotter = robot_plotter(_assembly(), exaggeration=20)
    colours = [actor.prop.color.hex_rgb for actor in plotter.actors.values()
               if hasattr(actor, "prop") and hasattr(actor.prop, "color")]  # fmt: skip
    plotter.close()
    joints = [f for f in _assembly().posture.robot.frames if f.joint != "fixed"]
    driven = sum(frame.actuated for frame in joints)
    assert colours.count("#ff8c00") == driven == 2  # dark orange
    assert colours.count("#202020") == len(joints) - driven


NO_BODY = ["--figure", "x.png", "--load", "fx=1", "--error-body", "translation",
           "--assumption", "budget"]  # fmt: skip


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--figure", "x.xyz"],
         'x.xyz: found the ending ".xyz", expected a picture: .png'),
        (NO_BODY, "--assumption: found budget together"),
        (["--figure", "x.png", "--exaggeration", "inf"], "--exaggeration: found inf"),
        (["--figure", "x.png", "--exaggeration", "1e300"],
         "--exaggeration: found 1e+300"),
        (["--closing"], "--closing: found no --figure, expected --figure FILE.gif"),
        (["--closing", "--figure", "x.png"],
         'x.png: found the ending ".png", expected an animation: .gif'),
        (["--figure", "x.gif"], 'x.gif: found the ending ".gif", expected a picture'),
        (["--closing", "--figure", "x.gif", "--error-body", "rotation"],
         "--closing: found together with --error-body"),
    ],
)  # fmt: skip
def test_picture_that_cannot_be_drawn_is_rejected_before_solving(
    run, tmp_path, monkeypatch, words, message
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(energy, "solve_assembly", None)
    status, out, err = run("assembly", "show", "five_bar", *words)
    assert (status, out) == (2, "")
    assert err.startswith(f"forcefit: {message}")
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_error_body_of_a_loaded_robot_uses_the_frozen_assumption(
    run, tmp_path, monkeypatch
):
    """The default assumption ``budget`` is not valid under a load."""
    readings, reach = [], error_body.reachable_screws

    def noted(answer, reading):
        readings.append(reading)
        return reach(answer, reading)

    monkeypatch.setattr(error_body, "reachable_screws", noted)
    write_robot(irsbot2_with(NUMBERS["cases"][0]), tmp_path / "robot.toml")
    words = [tmp_path / "robot.toml", "--pose", "tx=0.1,tz=-0.5", "--error-body",
             "translation", "--figure", tmp_path / "x.jpg"]  # fmt: skip
    for load in (["--load", "fx=10"], []):
        status, out, err = run("assembly", "show", *words, *load)
        assert (status, err) == (0, "")
        assert "2 freedoms: translates along x, z; 8 over-constraints" in out
    assert readings == ["frozen", "budget"]
    assert (tmp_path / "x.jpg").read_bytes().startswith(b"\xff\xd8\xff")


def test_robot_that_cannot_be_assembled_is_reported_and_not_drawn(run, tmp_path):
    path = tmp_path / "stuck.toml"
    frames = Frame("a"), Frame("b", geometric_error=[0, 0, 0, 1e-3, 0, 0])
    write_robot(Robot("stuck", "a", frames, (("a", "b"),)), path)
    status, out, err = run("assembly", "show", path, "--figure", tmp_path / "x.png")
    assert (status, err) == (1, "")
    assert out.splitlines()[-1].startswith("cannot assemble: ")
    assert [p.name for p in tmp_path.iterdir()] == ["stuck.toml"]


POSE = {"tx": 0.1, "tz": -0.5}
LONGER = 1e-3  # [m]


@pytest.fixture(scope="module")
def robot():
    """Return IRSBot-2 with a length error of one link."""
    perfect = load_robot("irsbot2")
    errors = np.zeros((len(perfect.frames), 6))
    errors[perfect.index("leg1.link_a"), 3] = LONGER
    return perfect.with_errors(errors)


@pytest.mark.parametrize("closing", [0.0, 0.3, 1.0])
def test_gaps_decrease_from_the_length_error_to_zero(robot, closing):
    """The largest gap is equal to the length error."""
    assembly = solve_assembly(place_robot(robot, pose=POSE))
    sizes = np.linalg.norm(closing_gaps(assembly, closing), axis=1)
    open_closures = sizes > 1e-12
    assert open_closures.any() == (closing < 1)
    expected = (1 - closing) * LONGER
    assert sizes[open_closures] == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.slow
def test_animation_ends_with_the_assembled_robot(robot, run, tmp_path):
    write_robot(robot, tmp_path / "long.toml")
    words = ["assembly", "show", tmp_path / "long.toml", "--pose", "tx=0.1,tz=-0.5",
             "--exaggeration", "50"]  # fmt: skip
    path = tmp_path / "close.gif"
    status, _, err = run(*words, "--closing", "--figure", path)
    assert (status, err) == (0, "")
    pictures, durations = [], []
    with Image.open(path) as moving:
        for k in range(moving.n_frames):
            moving.seek(k)
            pictures.append(np.asarray(moving.convert("RGB")).astype(int))
            durations.append(moving.info["duration"])
        assert moving.info["loop"] == 0  # without end
    assert len(pictures) == 25
    assert max(durations[1:-1]) < min(durations[0], durations[-1])
    pink = [np.minimum(p[..., 0], p[..., 2]) - p[..., 1] > 100 for p in pictures]
    assert pink[0].sum() > 50  # line in the gap
    assert pink[-1].sum() == 0
    moved = [np.abs(p - pictures[-1]).max(axis=2) > 60 for p in pictures]
    shares = [m.mean() for m in moved]
    assert shares[0] > shares[20] > shares[-1] == 0


def test_animation_of_a_robot_without_an_open_closure_is_rejected(
    run, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    words = ["assembly", "show", "five_bar", "--closing", "--figure", "x.gif"]
    message = "--closing: five_bar has no open closure; expected geometric errors"
    status, _, err = run(*words)
    assert (status, err.count("\n")) == (2, 1)
    assert err.startswith(f"forcefit: {message}")
    assert list(tmp_path.iterdir()) == []
