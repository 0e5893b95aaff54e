"""Reading of robot files of format 2 (bodies and joints), and error messages."""

import re

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.link_kinds import BeamLink
from forcefit.assembly.model.robot import BASE
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.inputs.table import BadInput

TSAI = """
format = 2
name = "tsai"
platform = "platform"
platform_at = [0, 0, "450 mm"]

[[body]]
name = "platform"
mass = 3.0
centre = [0, 0, "450 mm"]
inertia = [0.01, 0.01, 0.02, 0, 0, 0]

[[leg]]
name = "leg"
repeat = { count = 3, about = [0, 0, 1] }

[[leg.body]]
name = "tube"
[[leg.body]]
name = "rod"
link = { beam = { radius = "15 mm" }, young = 2.1e11, poisson = 0.3, density = 7800 }

[[leg.joint]]
name = "lower"
type = "universal"
between = ["base", "tube"]
at = ["240 mm", 0, 0]
axis = [0, 1, 0]
axis2 = [-45, 0, -16]

[[leg.joint]]
name = "slide"
type = "prismatic"
between = ["tube", "rod"]
at = ["240 mm", 0, 0]
axis = [-16, 0, 45]
actuated = true
drive_stiffness = 2e7

[[leg.joint]]
name = "upper"
type = "universal"
between = ["rod", "platform"]
at = ["80 mm", 0, "450 mm"]
axis = [-45, 0, -16]
axis2 = [0, 1, 0]
"""


@pytest.fixture
def read(tmp_path):
    """Return a function that reads a robot from a text."""

    def robot(text):
        path = tmp_path / "drawn.toml"
        path.write_text(text)
        return read_robot(path)

    return robot


def test_stiffness_of_3_upu_robot_agrees_with_another_program(read):
    """The reference is the stiffness K_C from another program, with 6 digits."""
    found = platform_stiffness(home_posture(read(TSAI))).stiffness
    expected = np.diag([162410, 162410, 35817, 3.16338e6, 3.16338e6, 5.00457e7])
    expected[0, 4] = expected[4, 0] = -711761
    expected[1, 3] = expected[3, 1] = 711761
    size = np.sqrt(np.diag(expected))
    assert np.abs((found - expected) / np.outer(size, size)).max() < 1e-5


def test_frames_have_the_names_of_joints_and_bodies(read):
    robot = read(TSAI)
    leg = ["lower.first", "lower.second", "slide", "rod", "upper.first", "upper.second"]
    names = [f"leg{k}.{name}" for k in (1, 2, 3) for name in leg]
    ends = ["leg2.upper.end", "leg3.upper.end"]
    assert {frame.name for frame in robot.frames} == {*names, *ends, "platform"}
    assert robot.platform == "platform"


def test_remark_lists_joints_that_close_loops(read):
    (cut,) = read(TSAI).remarks
    assert cut == (
        'loops close after "leg2.upper" (at "platform"), "leg3.upper" (at "platform")'
    )


def test_remark_lists_bodies_without_centre_of_mass(read):
    """Without ``centre``, the platform mass acts at the origin of the base."""
    text = TSAI.replace('centre = [0, 0, "450 mm"]\n', "")
    remark = 'masses without "centre", which act at the origin of the base: "platform"'
    assert remark in read(text).remarks
    assert not any("centre" in found for found in read(TSAI).remarks)


def test_remark_reports_assumed_end_joints_of_a_link(read):
    """There is no remark if the keys ``from`` and ``to`` specify the joints."""
    link = "link = { beam = { radius = 0.01 }, young = 7e10, poisson = 0.3 }"
    text = TSAI.replace("mass = 3.0", f"mass = 3.0\n{link}")
    remark = (
        'links between the first two joints of a body: "platform" from "leg1.upper" '
        'to "leg2.upper"'
    )
    assert remark in read(text).remarks
    text = text.replace(link, f'{link}\nfrom = "leg1.upper"\nto = "leg2.upper"')
    assert remark not in read(text).remarks


def test_legs_are_copied_about_an_axis_through_a_point(read):
    """The second leg is rotated by 180 degrees about the line x = 0.3, y = 0."""
    repeat = '{ count = 2, about = [0, 0, 2], at = ["300 mm", 0, 0] }'
    text = re.sub(r"repeat = .*", f"repeat = {repeat}", TSAI)
    text = text.replace(
        'platform_at = [0, 0, "450 mm"]', "platform_at = [0.3, 0, 0.45]"
    )
    robot = read(text)
    home = home_posture(robot).transforms
    slide = home[robot.index("leg2.slide"), :3, 3]
    assert slide == pytest.approx([0.36, 0, 0], abs=1e-15)


def test_mass_of_a_copied_leg_is_rotated(read):
    """The point (x, y) of the first leg corresponds to (0.6 - x, 0.2 - y)."""
    repeat = "{ count = 2, about = [0, 0, 1], at = [0.3, 0.1, 0] }"
    text = ARC.replace("{ count = 1, about = [0, 0, 1] }", repeat)
    text = text.replace(
        'name = "arc"', 'name = "arc"\nmass = 0.4\ncentre = [0.1, 0.2, 0.3]'
    )
    text = text.replace('between = ["arc", "hand"]', 'between = ["arc", "end"]')
    text = text.replace("[[leg.joint]]", '[[leg.body]]\nname = "end"\n[[leg.joint]]', 1)
    text = text.replace('[[body]]\nname = "hand"\n', "")
    robot = read(text.replace('platform = "hand"', 'platform = "leg1.end"'))
    centres = []
    for k in (1, 2):
        frame = robot.frame(f"leg{k}.arc")
        T = home_posture(robot).transforms[robot.index(frame.name)]
        centres.append(T[:3, :3] @ frame.centre_of_mass + T[:3, 3])
        assert frame.mass == pytest.approx(0.4 + 7800 * np.pi**2 / 20 * 0.005**2)
    x, y, z = centres[0]
    assert centres[1] == pytest.approx([0.6 - x, 0.2 - y, z], abs=1e-14)
    assert z == pytest.approx(0.3 * 0.4 / robot.frame("leg1.arc").mass)


def test_geometric_error_with_units_is_converted(read):
    """The first three numbers are angles, the last three are lengths."""
    written = '["1 mrad", "1 deg", 2, "1 mm", "1 um", "1 in"]'
    text = ARM.replace("position = 0.5", f"geometric_error = {written}")
    expected = [1e-3, np.pi / 180, 2, 1e-3, 1e-6, 0.0254]
    assert read(text).frame("turn").geometric_error == pytest.approx(expected)


@pytest.mark.parametrize(("written", "metres"), [
    ('"240 mm"', 0.24), ('"24e4 um"', 0.24), ('"0.24 m"', 0.24), ('"240mm"', 0.24),
    ('"10 in"', 0.254), ("0.24", 0.24),
])  # fmt: skip
def test_length_with_unit_is_converted(written, metres, read):
    robot = read(TSAI.replace('at = ["240 mm", 0, 0]', f"at = [{written}, 0, 0]"))
    assert robot.frames[0].translation == pytest.approx([metres, 0, 0], abs=1e-16)


def test_angle_with_unit_is_converted(read):
    text = ARM.replace("position = 0.5", 'position = "0.4 rad"')
    assert read(text).frame("turn").position == 0.4
    text = ARM.replace("position = 0.5", 'position = "30 deg"')
    assert read(text).frame("turn").position == pytest.approx(np.pi / 6, rel=1e-15)
    text = ARM.replace("tilt = 2e-4", 'tilt = "0.2 mrad"')
    assert read(text).frame("turn").clearance.tilt == pytest.approx(2e-4, rel=1e-15)


ARM = """
format = 2
platform = "hand"
platform_at = [0.6, 0, 0]

[[body]]
name = "arm"
link = { beam = { width = "20 mm", height = "30 mm" }, young = 7e10, poisson = 0.3 }
[[body]]
name = "hand"
mass = 2.0
centre = [0.6, 0, 0.1]

[[joint]]
name = "turn"
type = "revolute"
between = ["base", "arm"]
at = [0.1, 0, 0]
axis = [0, 0, 1]
actuated = true
position = 0.5
drive_stiffness = 1e4
clearance = { radial = "20 um", tilt = 2e-4 }
[[joint]]
name = "bolts"
type = "fixed"
between = ["arm", "hand"]
at = [0.6, 0, 0]
"""


def test_arm_of_format_2_has_correct_frames_and_link(read):
    """The drive stiffness, the link and the mass are also compared."""
    robot = read(ARM)
    turn, arm, hand = (robot.frame(name) for name in ("turn", "arm", "hand"))
    assert np.diag(turn.joint_stiffness).tolist() == [*[np.inf] * 2, 1e4, *[np.inf] * 3]
    assert isinstance(arm.link, BeamLink)
    assert arm.link.length == pytest.approx(0.5, rel=1e-15)
    assert (hand.mass, turn.parent) == (2.0, BASE)
    assert home_posture(robot).platform[:3, 3] == pytest.approx([0.6, 0, 0])


@pytest.mark.parametrize(("up", "soft"), [("", "TY"), (", up = [0, 1, 0]", "TZ")])
def test_height_of_a_beam_section_is_along_z_or_up(up, soft, read):
    """The deflection F L^3 / (3 E I) of a cantilever is smaller along its height."""
    text = ARM.replace('height = "30 mm"', f'height = "30 mm", theory = "euler"{up}')
    text = text.replace("drive_stiffness = 1e4\n", "")
    C = platform_stiffness(home_posture(read(text))).compliance
    I = {"TY": 0.03 * 0.02**3 / 12, "TZ": 0.02 * 0.03**3 / 12}  # for forces along y, z
    if soft == "TZ":
        I = {"TY": I["TZ"], "TZ": I["TY"]}
    for k, key in ((4, "TY"), (5, "TZ")):
        assert C[k, k] == pytest.approx(0.5**3 / (3 * 7e10 * I[key]), rel=1e-12)


ARC = """
format = 2
platform = "hand"
platform_at = [0, "100 mm", 0]

[[leg]]
name = "leg"
repeat = { count = 1, about = [0, 0, 1] }
[[leg.body]]
name = "arc"
[leg.body.link]
young = 2.1e11
poisson = 0.3
density = 7800
[[leg.body.link.curve]]
center = [0, 0, 0]
turn = [0, 0, "90 deg"]
section = { radius = "5 mm" }
[[leg.joint]]
name = "foot"
type = "fixed"
between = ["base", "arc"]
at = ["100 mm", 0, 0]
[[leg.joint]]
name = "wrist"
type = "fixed"
between = ["arc", "hand"]
at = [0, "100 mm", 0]
axis = [1, 2, 3]

[[body]]
name = "hand"
"""


def test_deflection_of_quarter_circle_arc_equals_textbook_formula(read):
    """The deflection is F r^3 (pi/4 / EI + (3 pi/4 - 2) / GJ) plus that by shear.

    The force F is perpendicular to the plane of the arc.
    """
    C = platform_stiffness(home_posture(read(ARC))).compliance
    r, rho, E, nu = 0.1, 0.005, 2.1e11, 0.3
    G, area, I = E / 2.6, np.pi * rho**2, np.pi * rho**4 / 4
    bending = r**3 * (np.pi / 4 / (E * I) + (3 * np.pi / 4 - 2) / (G * 2 * I))
    shear = np.pi / 2 * r / (G * area * 6 * (1 + nu) / (7 + 6 * nu))
    assert C[5, 5] == pytest.approx(bending + shear, rel=1e-10)


def test_mass_of_quarter_circle_arc_equals_textbook_formula(read):
    robot = read(ARC)
    arc = robot.frame("leg1.arc")
    mass = 7800 * np.pi * 0.005**2 * np.pi / 2 * 0.1
    T = home_posture(robot).transforms[robot.index("leg1.arc")]
    centre = T[:3, :3] @ arc.centre_of_mass + T[:3, 3]
    assert arc.mass == pytest.approx(mass, rel=1e-12)
    assert centre == pytest.approx([0.2 / np.pi, 0.2 / np.pi, 0], abs=1e-14)


def test_stiffness_of_a_copied_arc_is_rotated(read):
    """The stiffness of two legs is K + R K R^T for the rotation R of the second leg."""
    one = read(ARC)
    text = ARC.replace("count = 1, about = [0, 0, 1]", "count = 2, about = [0, 1, 0]")
    two = read(text)
    K, both = (platform_stiffness(home_posture(r)).stiffness for r in (one, two))
    turned = np.diag([-1, 1, -1, -1, 1, -1])  # rotation by 180 degrees about y
    expected = K + turned @ K @ turned
    size = np.sqrt(np.diag(expected))
    assert np.abs((both - expected) / np.outer(size, size)).max() < 1e-10


@pytest.mark.parametrize(("old", "new", "message"), [
    ('"90 deg"]', '"80 deg"]', "link.curve: found the end "),
    ('section = {', 'sektion = {', "section"),
    ("poisson = 0.3", "poisson = 0.3\nbeam = { radius = 0.1 }", "link.beam: found "),
])  # fmt: skip
def test_invalid_curve_is_rejected(old, new, message, read):
    with pytest.raises(BadInput) as caught:
        read(ARC.replace(old, new))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


# screw components of the free motions, and bounds that limit other motions
SEVERAL = {
    "cylindrical": ([2, 5], {"radial", "tilt"}),
    "spherical": ([0, 1, 2], {"radial", "axial"}),
    "planar": ([2, 3, 4], {"axial", "tilt"}),
}
STIFF = [2e3, 3e3, 5e3, 2e6, 3e6, 5e6]


def held_by(kind, keys):
    """Return a robot file with a joint of the given type and additional keys."""
    text = ARM.replace('type = "fixed"', f'type = "{kind}"\naxis = [0, 0, 1]\n{keys}')
    return text.replace("drive_stiffness = 1e4\n", "")


@pytest.mark.parametrize("full", [False, True], ids=["diagonal", "rows"])
@pytest.mark.parametrize("kind", SEVERAL)
def test_compound_joint_has_stiffness_only_in_constrained_directions(kind, full, read):
    """The stiffness must be zero along the free motions."""
    free = SEVERAL[kind][0]
    K = [0.0 if row in free else value for row, value in enumerate(STIFF)]
    values = np.diag(K).tolist() if full else K
    robot = read(held_by(kind, f"joint_stiffness = {values}"))
    stiff = np.zeros(6)
    for frame in robot.frames:
        if frame.name.startswith("bolts") and frame.joint_stiffness is not None:
            stiff = np.diag(frame.joint_stiffness)
    soft = [row for row in range(6) if row not in free]
    assert stiff[soft].tolist() == [STIFF[row] for row in soft]
    assert mobility(home_posture(robot)).freedoms == 1 + len(free)
    for row in free:
        wrong = [STIFF[k] if k == row else value for k, value in enumerate(K)]
        values = np.diag(wrong).tolist() if full else wrong
        with pytest.raises(BadInput, match=r"found a stiffness as number \d .*along a"):
            read(held_by(kind, f"joint_stiffness = {values}"))


@pytest.mark.parametrize("bound", ["radial", "axial", "tilt", "spin"])
@pytest.mark.parametrize("kind", SEVERAL)
def test_compound_joint_has_clearance_only_in_constrained_directions(kind, bound, read):
    text = held_by(kind, f"clearance = {{ {bound} = 1e-5 }}")
    if bound in SEVERAL[kind][1]:
        frames = [f for f in read(text).frames if f.name.startswith("bolts")]
        bounds = [getattr(f.clearance, bound) for f in frames if f.clearance]
        assert bounds == [1e-5]
    else:
        with pytest.raises(
            BadInput, match=rf"clearance\.{bound}: found a bound of a f"
        ):
            read(text)


def test_link_of_a_platform_with_one_joint_ends_at_reference_point(read):
    """The deflection of the reference point is F L^3 / (3 E I)."""
    text = ARM[: ARM.index('[[joint]]\nname = "bolts"')].replace('"hand"', '"arm"', 1)
    text = text.replace(
        '[[body]]\nname = "hand"\nmass = 2.0\ncentre = [0.6, 0, 0.1]', ""
    )
    text = text.replace("drive_stiffness = 1e4\n", "")
    text = text.replace('height = "30 mm"', 'height = "30 mm", theory = "euler"')
    C = platform_stiffness(home_posture(read(text))).compliance
    I = 0.02 * 0.03**3 / 12
    assert C[5, 5] == pytest.approx(0.5**3 / (3 * 7e10 * I), rel=1e-12)


def inertia_in_base_axes(robot, name):
    """Return the inertia matrix of a frame in base axes, (3, 3) [kg m^2]."""
    R = home_posture(robot).transforms[robot.index(name)][:3, :3]
    return R @ robot.frame(name).inertia @ R.T


def test_inertia_of_a_copied_leg_is_rotated(read):
    """A rotation by 180 degrees about z changes the signs of Ixz and Iyz."""
    text = ARC.replace("count = 1", "count = 2").replace("  density = 7800\n", "")
    text = text.replace("density = 7800\n", "").replace(
        'name = "arc"', 'name = "arc"\ninertia = [3, 4, 5, 0.1, 0.2, 0.3]'
    )
    text = text.replace('between = ["arc", "hand"]', 'between = ["arc", "end"]')
    text = text.replace("[[leg.joint]]", '[[leg.body]]\nname = "end"\n[[leg.joint]]', 1)
    text = text.replace('[[body]]\nname = "hand"\n', "")
    robot = read(text.replace('platform = "hand"', 'platform = "leg1.end"'))
    for leg, sign in (("leg1", 1), ("leg2", -1)):
        expected = [[3, 0.1, 0.2 * sign], [0.1, 4, 0.3 * sign],
                    [0.2 * sign, 0.3 * sign, 5]]  # fmt: skip
        J = inertia_in_base_axes(robot, f"{leg}.arc")
        np.testing.assert_allclose(J, expected, atol=1e-14)


def test_inertia_of_quarter_circle_arc_equals_hand_calculation(read):
    """The arc consists of thin discs of radius rho with the mass m.

    Each has the moment m rho^2 / 4 about a diameter and m rho^2 / 2 about the tangent.
    A sphere of 2 kg at the origin is added by the parallel axis theorem.
    """
    r, rho, mass = 0.1, 0.005, 7800 * np.pi * 0.005**2 * np.pi / 2 * 0.1
    c = 2 / np.pi * r
    about_axis = mass * (r**2 + rho**2 / 4) - mass * 2 * c**2
    across = mass * (r**2 / 2 + rho**2 / 4 * 1.5) - mass * c**2
    product = -(mass * r**2 / np.pi - mass * c**2) - mass * rho**2 / 4 / np.pi
    expected = [[across, product, 0], [product, across, 0], [0, 0, about_axis]]
    J = inertia_in_base_axes(read(ARC), "leg1.arc")
    np.testing.assert_allclose(J, expected, rtol=1e-10, atol=1e-15)
    ball = 2 / 5 * 2 * 0.03**2
    text = ARC.replace(
        'name = "arc"', f'name = "arc"\nmass = 2\ninertia = {[ball] * 3 + [0] * 3}'
    )
    whole, way = read(text).frame("leg1.arc"), np.array([c, c, 0])
    assert whole.mass == pytest.approx(2 + mass, rel=1e-14)
    both = 2 * mass / (2 + mass)  # reduced mass of sphere and arc
    expected += ball * np.eye(3) + both * (way @ way * np.eye(3) - np.outer(way, way))
    J = inertia_in_base_axes(read(text), "leg1.arc")
    np.testing.assert_allclose(J, expected, rtol=1e-10, atol=1e-15)


def test_file_with_bodies_is_read_without_format_key(read):
    assert read(TSAI.replace("format = 2\n", "")).platform == "platform"


def test_bearings_of_universal_joint_have_common_or_separate_clearances(read):
    """The clearance is one table for both bearings, or a list of two tables."""
    both = "axis2 = [0, 1, 0]\nclearance = { radial = 1e-5, tilt = 1e-4 }"
    pair = "axis2 = [0, 1, 0]\nclearance = [{ radial = 1e-5 }, { axial = 2e-5 }]"
    for text, expected in ((both, (1e-5, None)), (pair, (None, 2e-5))):
        robot = read(TSAI.replace("axis2 = [0, 1, 0]", text))
        first = robot.frame("leg1.upper.first").clearance
        second = robot.frame("leg1.upper.second").clearance
        assert first.radial == 1e-5
        assert (second.radial, second.axial) == expected


REFUSED = {
    "format": ("format = 2", "format = 3", "format: found 3, expected 1 | 2"),
    "format of frames": (
        "format = 2", "format = 1",
        "format: found 1 in a file with bodies and joints, expected 2"),
    "a frame": (
        "[[leg]]", '[[frame]]\nname = "tip"\n[[leg]]', 'unknown key "frame"'),
    "unknown body": (
        'between = ["tube", "rod"]', 'between = ["tube", "rud"]',
        'leg "leg".joint "slide".between: found "rud", expected a body or "base"; did '
        'you mean "rod"?'),
    "unknown type": (
        'type = "prismatic"', 'type = "prismatc"',
        'leg "leg".joint "slide".type: found \'prismatc\', expected "fixed" | "revol'),
    "unknown key": (
        "drive_stiffness", "drive_stifness",
        'leg "leg".joint "slide": unknown key "drive_stifness"; did you mean '),
    "unknown key of a leg": (
        'name = "leg"', 'name = "leg"\nrepeats = 3',
        'leg "leg": unknown key "repeats"; did you mean "repeat"?'),
    "unknown key of a body": (
        "mass = 3.0", "weight = 3.0", 'body "platform": unknown key "weight"'),
    "parallel axes": (
        "axis2 = [0, 1, 0]", "axis2 = [-45, 1e-3, -16]",
        'leg "leg".joint "upper".axis2: found a direction parallel to "axis"'),
    "missing second axis": (
        "axis2 = [0, 1, 0]", "",
        'leg "leg".joint "upper".axis2: missing; expected 3 finite numbers'),
    "no direction": (
        "axis = [-16, 0, 45]", "axis = [0, 0, 0]",
        'leg "leg".joint "slide".axis: found a zero vector, expected a nonzero '),
    "a body without joints": (
        '[[leg]]', '[[body]]\nname = "lost"\n[[leg]]',
        'body "lost": found no chain of joints that connects it to "base", expected'),
    "two bodies of a name": (
        '[[leg]]', '[[body]]\nname = "platform"\n[[leg]]',
        'body: found "platform" twice, expected different names'),
    "two joints of a name": (
        'name = "upper"', 'name = "slide"',
        'joint: found "leg1.slide" twice, expected different names'),
    "base": (
        'name = "tube"', 'name = "base"',
        'leg "leg".body "base".name: found "base", which is reserved; '),
    "a body with itself": (
        'between = ["tube", "rod"]', 'between = ["rod", "rod"]',
        'leg "leg".joint "slide".between: found "rod" twice, expected two bodies'),
    "platform": (
        'platform = "platform"', 'platform = "platfrom"',
        'platform: found "platfrom", expected the name of a body; did you mean '),
    "unit of another dimension": (
        '"80 mm"', '"80 deg"',
        'leg "leg".joint "upper".at: found \'80 deg\', expected a number, or a text '
        'with a unit such as "200 mm" (m mm um in)'),
    "drive of a universal joint": (
        "axis2 = [0, 1, 0]", "axis2 = [0, 1, 0]\nactuated = true",
        'leg "leg".joint "upper".actuated: found on a universal joint, expected '),
    "stiffness of a passive drive": (
        "actuated = true", "",
        'leg "leg".joint "slide".drive_stiffness: found a stiffness without actuated'),
    "negative tolerance": (
        "drive_stiffness = 2e7", "tolerance = [0, 0, 0, -1e-5, 0, 0]",
        'leg "leg".joint "slide".tolerance: found the number -1e-05, expected 6 '),
    "one body": (
        'between = ["tube", "rod"]', 'between = ["tube"]',
        'leg "leg".joint "slide".between: found [\'tube\'], expected two names'),
    "end of a link": (
        'name = "rod"', 'name = "rod"\nto = "lower"',
        'leg "leg".body "rod".to: found "lower", expected a joint of this body'),
    "a bore without its gap": (
        "axis2 = [0, 1, 0]", 'axis2 = [0, 1, 0]\nclearance = { length = "30 mm" }',
        'leg "leg".joint "upper", first bearing.clearance.radial: missing; '),
    "a bore without length": (
        "axis2 = [0, 1, 0]",
        "axis2 = [0, 1, 0]\nclearance = { radial = 1e-5, length = 0 }",
        'leg "leg".joint "upper", first bearing.clearance.length: found 0, '),
    "tilt of a bore": (
        "drive_stiffness = 2e7",
        "clearance = { radial = 1e-5, length = 0.1, tilt = 1 }",
        'leg "leg".joint "slide".clearance.tilt: found together with "length", '),
    "unknown key of a clearance": (
        "drive_stiffness = 2e7", "clearance = { radial = 1e-5, lenght = 0.1 }",
        'leg "leg".joint "slide".clearance: unknown key "lenght"; did you '),
    "length of a ball": (
        'name = "upper"\ntype = "universal"',
        'name = "upper"\ntype = "spherical"\nclearance = { length = 0.1 }',
        'leg "leg".joint "upper".clearance.length: found the clearance of a sh'),
    "a guide of a cross": (
        "axis2 = [0, 1, 0]", "axis2 = [0, 1, 0]\nclearance = { guide = { gap = 1 } }",
        'first bearing.clearance.guide: found on a revolute joint, expected none'),
    "a guide with tilt": (
        "drive_stiffness = 2e7", "clearance = { tilt = 1e-4, guide = { gap = 1e-5 } }",
        'leg "leg".joint "slide".clearance.tilt: found together with "guide", which '),
    "a guide of negative gap": (
        "drive_stiffness = 2e7",
        "clearance = { guide = { gap = [1, -1], length = 1, width = 1, height = 1 } }",
        'leg "leg".joint "slide".clearance.guide.gap: found -1, expected 2 numbers >='),
    "a guide and a bore": (
        "drive_stiffness = 2e7", "clearance = { length = 0.1, guide = { gap = 1e-5 } }",
        '.clearance.guide: found together with "length", expected only one of them'),
    "three bearings": (
        "drive_stiffness = 2e7", "clearance = { bearings = [1, 2, 3] }",
        'leg "leg".joint "slide".clearance.bearings: found [1, 2, 3], expected two t'),
    "bearings at one place": (
        "drive_stiffness = 2e7",
        "clearance = { bearings = [{ z = 0, radial = 1 }, { z = 0, radial = 1 }] }",
        'leg "leg".joint "slide".clearance.bearings: found both bearings at z = 0 m'),
    "radial beside bearings": (
        "drive_stiffness = 2e7", "clearance = { radial = 1, bearings = [] }",
        'leg "leg".joint "slide".clearance.radial: found together with "bearings", '),
    "a pad on a slide": (
        "drive_stiffness = 2e7", "clearance = { pad = { gap = 1e-5 } }",
        'leg "leg".joint "slide".clearance.pad: found on a prismatic joint, exp'),
    "clearances of three bearings": (
        "axis2 = [0, 1, 0]", "axis2 = [0, 1, 0]\nclearance = [{}, {}, {}]",
        'leg "leg".joint "upper".clearance: found a list of 3, expected one'),
    "errors of one bearing in a list": (
        "axis2 = [0, 1, 0]",
        "axis2 = [0, 1, 0]\ngeometric_error = [[0, 0, 0, 0, 0, 0]]",
        'leg "leg".joint "upper".geometric_error: found a list of 1, expected one '),
    "a misspelt curve": (
        "beam = { radius", "curv = { radius",
        'leg "leg".body "rod".link: unknown key "curv"; did you mean "curve"?'),
    "a link of no kind": (
        'beam = { radius = "15 mm" }, ', "",
        'expected exactly one of "beam" | "curve" | "stiffness" | "mesh" | "library"'),
    "the name of another joint's frame": (
        'name = "slide"', 'name = "lower.second"',
        'joint "leg1.lower.second": found "leg1.lower.second" as the name of a frame, '
        'which is also the name of a frame of joint "leg1.lower"; expected a different '
        "name"),
    "copies": (
        "count = 3", "count = 0",
        'leg "leg".repeat.count: found 0, expected a whole number >= 1'),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_invalid_bodies_and_joints_are_rejected(case, read):
    old, new, message = REFUSED[case]
    assert old in TSAI
    with pytest.raises(BadInput) as caught:
        read(TSAI.replace(old, new))
    text = str(caught.value)
    assert "\n" not in text
    assert message in text
    assert "drawn.toml" in text


SLOTTED = """
format = 2
platform = "arm"
platform_at = [0.5, 0, 0]
body = [{ name = "stand" }, { name = "arm" }]
[[joint]]
name = "slot"
type = "fixed"
between = ["base", "stand"]
at = [0, 0, 0]
clearance = { radial = 1e-4 }
locked_at = LOCKED
[[joint]]
name = "hinge"
type = "revolute"
between = ["stand", "arm"]
at = [0, 0, 0]
axis = [0, 0, 1]
actuated = true
"""


@pytest.mark.parametrize(
    ("written", "plain"),
    [
        ('{ joints = { hinge = "90 deg" } }', {"hinge": np.pi / 2}),
        ('{ pose = { tx = "400 mm" } }', {"tx": 0.4}),
        ('{ pose = { rz = "30 deg" } }', {"rz": np.pi / 6}),
    ],
)
def test_bolting_pose_with_units_is_converted(read, written, plain):
    bolt = read(SLOTTED.replace("LOCKED", written)).frames[0].locked_at
    assert {**bolt.pose, **bolt.joints} == pytest.approx(plain)


def test_bolting_angle_with_length_unit_is_rejected(read):
    text = SLOTTED.replace("LOCKED", '{ joints = { hinge = "90 mm" } }')
    with pytest.raises(BadInput, match=r'"slot".locked_at.joints.hinge: found .90 mm'):
        read(text)


@pytest.mark.parametrize(
    ("word", "wrong", "message"),
    [
        ("[[body]]", "[[bodies]]", 'unknown key "bodies"; did you mean "body"?'),
        ("[[leg.body]]", "[[leg.bodies]]",
         'leg "leg": unknown key "bodies"; did you mean "body"?'),
        ("[[leg]]", "[[legs]]", 'unknown key "legs"; did you mean "leg"?'),
    ],
)  # fmt: skip
def test_error_message_suggests_name_for_misspelt_table(read, word, wrong, message):
    text = TSAI.replace(word, wrong)
    if word == "[[leg]]":
        text = text.replace("[[leg.", "[[legs.")
    with pytest.raises(BadInput) as error:
        read(text)
    assert message in str(error.value)
