"""Conversion of robots from frames and closures to bodies and joints."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from forcefit.assembly.exchange.convert import convert
from forcefit.assembly.exchange.robot_files import load_robot
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.model.frame import between_origins
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.platform_stiffness.vibration import natural_modes
from forcefit.assembly.robots import BUILT_IN

SAME = 1e-12
LITERATURE = Path(__file__).parents[4] / "shared" / "cases" / "robots"
OTHERS = ("agile_err", "bennett", "exechon_err", "gpm_err", "prs", "snu_err",
          "tsai_err", "bolted_four_bar")  # fmt: skip
DRAWN = Path(__file__).parents[3] / "examples" / "drawn"
ALONE = """
name = "odd"
platform = "tip"
[[frame]]
name = "arm"
parent = "base"
joint = "revolute"
actuated = true
[[frame]]
name = "tip"
parent = "arm"
translation = [0.1, 0, 0]
"""


@pytest.fixture(params=[*BUILT_IN, *OTHERS])
def robots(request, tmp_path):
    """Return a robot from bodies and joints, and the original robot with frames."""
    name = request.param
    if name in BUILT_IN:
        robot = load_robot(name)
    elif not (LITERATURE / f"{name}.toml").exists():
        pytest.skip(f"{LITERATURE} is not here")
    else:
        robot = read_robot(LITERATURE / f"{name}.toml")
    source = name if name in BUILT_IN else LITERATURE / f"{name}.toml"
    done = convert(source, tmp_path / "drawn.toml", version=2)
    assert done.difference < SAME
    return read_robot(tmp_path / "drawn.toml"), robot


def relative_change(reference, K):
    """Return the largest difference of entries, divided by sqrt(K_ii K_jj)."""
    size = np.sqrt(np.abs(np.diag(reference)).clip(1e-12))
    return np.abs((K - reference) / np.outer(size, size)).max()


def with_last_digits(posture):
    """Yield K_C after random changes of the last digit of the robot's lengths.

    They change K_C of the IRSBot-2 by up to 9e-13, and of other robots by 1e-14.
    """
    rng = np.random.default_rng(0)
    for _ in range(3):
        frames = tuple(
            replace(
                f, translation=f.translation * (1 + 2.2e-16 * rng.uniform(-1, 1, 3))
            )
            for f in posture.robot.frames
        )
        robot = replace(posture.robot, frames=frames)
        yield platform_stiffness(replace(posture, robot=robot)).stiffness


def compare(drawn, framed):
    """Compare poses, stiffness, mobility, zone margin and energy."""
    at, expected = (posture.platform[:3, 3] for posture in (drawn, framed))
    assert np.abs(at - expected).max() < SAME
    K, reference = (platform_stiffness(each).stiffness for each in (drawn, framed))
    rounding = max(relative_change(reference, K) for K in with_last_digits(framed))
    assert relative_change(reference, K) < SAME + 2 * rounding
    found, counted = (mobility(posture) for posture in (drawn, framed))
    assert found.platform_freedoms == counted.platform_freedoms
    assert found.redundant_constraints == counted.redundant_constraints
    zones = [zone_margin(each, "rigid") for each in (drawn, framed)]
    # each margin is known only with the accuracy of its certified bound
    unsure = sum(zone.margin - zone.bound for zone in zones if zone.margin < np.inf)
    assert zones[0].margin == pytest.approx(zones[1].margin, SAME, abs(unsure) + SAME)
    # the SNU robot is singular in its home pose
    gravity = None if "snu" in framed.robot.name else [0, 0, -9.81]
    solved, least = (solve_assembly(p, gravity=gravity) for p in (drawn, framed))
    # the solver minimises energy minus work, which can be much larger than the energy
    most = least.energy + abs(least.work)
    assert abs(solved.energy - least.energy) <= SAME * most
    assert abs(solved.work - least.work) <= SAME * most


def test_converted_robot_is_equal_in_home_pose(robots):
    compare(*(home_posture(robot) for robot in robots))


def test_converted_robot_is_equal_in_another_pose(robots):
    """The drive coordinates are changed by 0.01 rad or 0.01 m."""
    if "snu" in robots[1].name or "gpm" in robots[1].name:
        pytest.skip("home is singular, or two drives determine the third")
    step = {f.name: f.position + 0.01 for f in robots[1].frames if f.actuated}
    compare(*(place_robot(robot, joints=step) for robot in robots))


def test_ball_and_universal_joints_are_recognised(tmp_path):
    """Each leg of a 6-UPS robot has a universal, a prismatic and a spherical joint."""
    convert("hexapod", tmp_path / "drawn.toml", version=2)
    text = (tmp_path / "drawn.toml").read_text()
    for kind in ("universal", "prismatic", "spherical"):
        assert text.count(f'type = "{kind}"') == 6
    assert text.count("[[joint]]") == 18
    assert text.count("[[body]]") == 13  # platform, tubes and rods
    assert 'between = ["base", "leg1.strut"]' in text


@pytest.mark.parametrize("name", ["three_upu", "tricept", "agile_eye"])
def test_robots_are_equal_after_conversion_to_frames_and_back(name, tmp_path):
    convert(DRAWN / f"{name}.toml", tmp_path / "frames.toml")
    convert(tmp_path / "frames.toml", tmp_path / "back.toml", version=2)
    files = (tmp_path / "back.toml", DRAWN / f"{name}.toml")
    compare(*(home_posture(load_robot(path)) for path in files))


def test_converted_helical_joint_has_same_pitch(tmp_path):
    """A rotation of the drive by 360 degrees lowers the table by the pitch of 5 mm."""
    source = LITERATURE.with_name("robots_drawn") / "screw.toml"
    if not source.exists():
        pytest.skip(f"{source} is not here")
    convert(source, tmp_path / "frames.toml")
    convert(tmp_path / "frames.toml", tmp_path / "drawn.toml", version=2)
    text = (tmp_path / "drawn.toml").read_text()
    assert 'name = "column"\ntype = "cylindrical"' in text
    assert "drive_stiffness = 200.0" in text
    robot = load_robot(tmp_path / "drawn.toml")
    turned = place_robot(robot, joints={"bearing": 2 * np.pi})
    assert turned.pose()["tz"] == pytest.approx(0.4 - 0.005, abs=1e-12)


def test_conversion_reports_rotated_platform_axes(run, tmp_path):
    """In format 2, the platform axes coincide with the base axes in the home pose."""
    status, out, err = run(
        "convert", "arm6", "-o", tmp_path / "arm.toml", "--format", "2", "--json",
        tmp_path / "o.json",
    )  # fmt: skip
    assert (status, err) == (0, "")
    assert (
        "left out: axes of the platform, which are rotated by [0, 1.5708, 0] rad" in out
    )
    rotation = home_posture(load_robot(tmp_path / "arm.toml")).platform[:3, :3]
    np.testing.assert_allclose(rotation, np.eye(3), atol=1e-15)


@pytest.mark.parametrize(("words", "text", "message"), [
    (["-o", "x.xml", "--format", "2"], "", "--format 2: found together with the file"),
    (["-o", "x.toml", "--format", "3"], "", "--format: found 3, expected 1 or 2"),
    # the closure connects two frames of the same body
    (["-o", "x.toml", "--format", "2"], '[[frame]]\nname = "spot"\nparent = "arm"\n'
     'translation = [0.1, 0, 0]\n[[closure]]\nframes = ["tip", "spot"]\n',
     'closure[1] ("tip", "spot"): found a connection between two frames of the same '),
    (["-o", "x.toml", "--format", "2"], '[[effect]]\nname = "function"\nwhere = "tip"\n'
     'kind = "geometric_error"\ncomponents = ["TX"]\nform = "constant"\n'
     "parameters = { a = 1e-4 }\n", "effect"),
])  # fmt: skip
def test_invalid_conversion_to_format_2_is_rejected(
    run, tmp_path, monkeypatch, words, text, message
):
    monkeypatch.chdir(tmp_path)
    Path("odd.toml").write_text(ALONE + text)
    status, out, err = run("convert", "odd.toml", *words)
    assert (status, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["odd.toml"]


def test_conversion_reports_nominal_closure_error(tmp_path):
    """The distance between the two frames of the closure is 1e-8 m."""
    (tmp_path / "rounded.toml").write_text(
        ALONE.replace(
            'name = "tip"\nparent = "arm"', 'name = "tip"\nparent = "pin"'
        ).replace("translation = [0.1, 0, 0]\n", "")
        + '[[frame]]\nname = "pin"\nparent = "arm"\njoint = "revolute"\n'
        'translation = [0.1, 0, 0]\n[[frame]]\nname = "rocker"\nparent = "base"\n'
        'joint = "revolute"\ntranslation = [0.1, 0.2, 0]\n[[frame]]\nname = "end"\n'
        'parent = "rocker"\ntranslation = [0, -0.2, 1e-8]\n[[closure]]\n'
        'frames = ["tip", "end"]\n'
    )
    done = convert(tmp_path / "rounded.toml", tmp_path / "drawn.toml", version=2)
    assert any("nominal closure error" in line for line in done.left_out)


def test_masses_of_one_body_are_added(tmp_path):
    """The natural frequencies do not change."""
    (tmp_path / "heavy.toml").write_text(
        ALONE.replace(
            "actuated = true",
            "actuated = true\njoint_stiffness = [3e4, 3e4, 2e4, 1e7, 1e7, 1e7]",
        )
        + "mass = 2.0\ncentre_of_mass = [0.02, 0.01, 0]\n"
        "inertia = [0.01, 0.02, 0.02, 0.001, 0, 0.002]\nrotation = [0.3, 0.1, 0.2]\n"
        '[[frame]]\nname = "flange"\nparent = "tip"\ntranslation = [0, 0.2, 0.1]\n'
        "mass = 1.5\ncentre_of_mass = [0, 0.1, 0]\n"
    )
    convert(tmp_path / "heavy.toml", tmp_path / "drawn.toml", version=2)
    text = (tmp_path / "drawn.toml").read_text()
    assert text.count("mass = 3.5") == 1
    assert text.count("inertia = ") == 1
    found, expected = (
        natural_modes(home_posture(load_robot(tmp_path / f"{name}.toml"))).frequencies
        for name in ("drawn", "heavy")
    )
    np.testing.assert_allclose(found, expected, rtol=1e-10)


def test_conversion_preserves_directions_of_a_mesh(tmp_path):
    """The link direction and the height direction are compared in base axes."""
    mesh = Path(__file__).parents[3] / "meshes" / "distal_plain.stl"
    (tmp_path / "mesh.toml").write_text(
        ALONE.replace('name = "tip"\nparent = "arm"\n', 'name = "elbow"\n'
                      'parent = "arm"\nrotation = [0.4, -0.2, 0.9]\n'
                      'joint = "revolute"\n'
                      f'link = {{ mesh = {{ surface = "{mesh}", base = "z=0", tip = '
                      '"z=0.452", up = [1, 0, 0] }, young = 6e10, poisson = 0.3 }\n'
                      "up = [0.3, 0.2, 1.0]\n")
        .replace('parent = "base"\n', 'parent = "base"\nrotation = [0.3, 0.2, 0.1]\n')
        + '[[frame]]\nname = "tip"\nparent = "elbow"\ntranslation = [0.2, 0, 0]\n'
    )  # fmt: skip
    convert(tmp_path / "mesh.toml", tmp_path / "drawn.toml", version=2)
    found = []
    for name in ("mesh", "drawn"):
        robot = load_robot(tmp_path / f"{name}.toml", links=False)
        (i,) = (i for i, f in enumerate(robot.frames) if f.link is not None)
        link, R = robot.frames[i].link, home_posture(robot).transforms[i][:3, :3]
        axis = between_origins(robot.frames[i]) if link.axis is None else link.axis
        found.append([R @ axis / np.linalg.norm(axis), R @ link.frame_up])
    np.testing.assert_allclose(found[1], found[0], atol=1e-12)


BALL_ON_A_TABLE = """
format = 2
name = "ball"
platform = "table"
platform_at = [0.1, 0, 0.2]
[[body]]
name = "table"
[[joint]]
name = "ball"
type = "spherical"
between = ["table", "base"]
at = [0, 0, 0]
geometric_error = [0, 0, 0, 1e-4, 2e-4, 3e-4]
"""
ROD_TO_THE_PLATE_AND_FLAG = """
name = "flag"
platform = "plate"
[[frame]]
name = "p"
parent = "base"
translation = [0.3, 0, 0]
joint = "revolute"
[[frame]]
name = "plate"
parent = "p"
[[frame]]
name = "q"
parent = "base"
joint = "revolute"
actuated = true
[[frame]]
name = "rod"
parent = "q"
translation = [0.3, 0, 0]
link = { beam = { radius = 0.01 }, young = 7e10, poisson = 0.3 }
[[frame]]
name = "flag"
parent = "plate"
translation = [0, 0.1, 0]
link = { beam = { radius = 0.01 }, young = 7e10, poisson = 0.3 }
[[closure]]
frames = ["rod", "plate"]
"""


@pytest.mark.parametrize("text", [BALL_ON_A_TABLE, ROD_TO_THE_PLATE_AND_FLAG])
def test_names_are_unique_after_conversion(text, tmp_path):
    """Robots with a ball joint with an error, and with two bodies that are combined."""
    (tmp_path / "given.toml").write_text(text)
    convert(tmp_path / "given.toml", tmp_path / "frames.toml", version=1)
    done = convert(tmp_path / "frames.toml", tmp_path / "drawn.toml", version=2)
    assert done.difference < SAME
