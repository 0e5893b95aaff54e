"""The animation of a robot that closes: gaps shrink to zero, and pictures change."""

import numpy as np
import pytest
from PIL import Image

from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.report.plot_closing import closing_gaps
from forcefit.assembly.robots import load_robot

POSE = {"tx": 0.1, "tz": -0.5}
LONGER = 1e-3  # [m]


@pytest.fixture(scope="module")
def robot():
    """The paper's robot, in which one link is too long."""
    perfect = load_robot("irsbot2")
    errors = np.zeros((len(perfect.frames), 6))
    errors[perfect.index("leg1.link_a"), 3] = LONGER
    return perfect.with_errors(errors)


@pytest.mark.parametrize("closing", [0.0, 0.3, 1.0])
def test_gaps_shrink_from_the_length_error_to_zero(robot, closing):
    """A pure translation is as long at the end of its chain as where it arises."""
    assembly = solve_assembly(place_robot(robot, pose=POSE))
    sizes = np.linalg.norm(closing_gaps(assembly, closing), axis=1)
    open_closures = sizes > 1e-12
    assert open_closures.any() == (closing < 1)
    expected = (1 - closing) * LONGER
    assert sizes[open_closures] == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.slow
def test_animation_begins_open_and_ends_as_the_picture_of_the_assembly(
    robot, run, tmp_path
):
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
    assert pink[0].sum() > 50  # the line across the gap
    assert pink[-1].sum() == 0
    moved = [np.abs(p - pictures[-1]).max(axis=2) > 60 for p in pictures]
    shares = [m.mean() for m in moved]
    assert shares[0] > shares[20] > shares[-1] == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--closing"], "--closing: found no --figure, expected --figure FILE.gif"),
        (["--closing", "--figure", "x.png"],
         'x.png: found the ending ".png", expected an animation: .gif'),
        (["--figure", "x.gif"], 'x.gif: found the ending ".gif", expected a picture'),
        (["--closing", "--figure", "x.gif", "--error-body", "rotation"],
         "--closing: found it together with --error-body"),
        (["--closing", "--figure", "x.gif"],
         "--closing: five_bar has no open closure; expected geometric errors"),
    ],
)  # fmt: skip
def test_animation_that_cannot_be_drawn_is_refused(
    run, tmp_path, monkeypatch, words, message
):
    monkeypatch.chdir(tmp_path)
    status, _, err = run("assembly", "show", "five_bar", *words)
    assert status == 2
    assert err.startswith(f"forcefit: {message}")
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
