"""Free motions, errors and stiffness of all joint types."""

import numpy as np
import pytest

from forcefit.assembly.drawing.drawing import (
    Drawing,
    DrawnBody,
    DrawnJoint,
    JointNumbers,
    perpendicular,
    unit,
)
from forcefit.assembly.drawing.frames import robot_of_drawing
from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.nominal import mobile, motion_screws
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.closure import linearise
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.model.link_kinds import MatrixLink
from forcefit.assembly.model.robot import BASE, Clearance
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.stiffness.screws import screw_map

AT, AXIS, AXIS2 = (
    np.array([0.1, -0.2, 0.3]), unit([1.0, 2.0, 2.0]), unit([2.0, 1.0, -1]),
)  # fmt: skip
# free screws in the joint frame, by joint type
RX, RY, RZ, TX, TY, TZ = np.eye(6)
PITCH = 0.02  # [m]
FREE = {
    "fixed": [], "revolute": [RZ], "prismatic": [TZ], "cylindrical": [RZ, TZ],
    "spherical": [RX, RY, RZ], "planar": [RZ, TX, TY],
    "helical": [RZ + PITCH / (2 * np.pi) * TZ],
}  # fmt: skip


def joint(kind, first="base", second="table", name="j", at=AT, **more):
    across = perpendicular(AXIS, AXIS2)
    if kind == "helical":
        more["pitch"] = PITCH
    return DrawnJoint(name, kind, first, second, at, AXIS, across, AXIS2, **more)


def robot(*joints, bodies=("table",), platform="table", links=None):
    drawn = tuple(DrawnBody(name, **(links or {}).get(name, {})) for name in bodies)
    at = np.array([0.4, 0.1, 0.2])
    return robot_of_drawing(Drawing("drawn", platform, at, drawn, tuple(joints)))


def axes():
    across = perpendicular(AXIS, AXIS2)
    return np.column_stack([across, np.cross(AXIS, across), AXIS])


@pytest.mark.parametrize("kind", [*FREE, "universal"])
def test_joint_has_free_motions_of_its_type(kind):
    """The screws of the joint frames span the free screws of the joint type."""
    drawn = robot(joint(kind))
    screws = motion_screws(drawn, home_posture(drawn).transforms)[mobile(drawn)]
    if kind == "universal":
        expected = [[*axis, *np.cross(AT, axis)] for axis in (AXIS, AXIS2)]
    else:
        expected = [screw_map(AT, axes()) @ screw for screw in FREE[kind]]
    count = len(expected)
    assert mobility(home_posture(drawn)).platform_freedoms == count
    both = np.array([*screws, *expected]).reshape(-1, 6)
    values = np.linalg.svd(both, compute_uv=False) if count else np.zeros(1)
    assert (values > 1e-12).sum() == count == len(screws)


@pytest.mark.parametrize(("kind", "step"), [
    ("revolute", [*(0.3 * AXIS)]), ("prismatic", [*(0.3 * AXIS)]),
])  # fmt: skip
@pytest.mark.parametrize("reverse", [False, True])
def test_joint_coordinate_moves_second_body_along_axis(kind, step, reverse):
    """The direction does not depend on which body is nearer to the base."""
    ends = ("table", "base") if reverse else ("base", "table")
    drawn = robot(joint(kind, *ends, actuated=True, position=0.2))
    moved = place_robot(drawn, joints={"j": 0.5}).pose()
    sign = -1 if reverse else 1
    if kind == "prismatic":
        at = np.array([0.4, 0.1, 0.2]) + sign * np.array(step)
        expected = [*at, 0, 0, 0]
        assert list(moved.values()) == pytest.approx(expected, abs=1e-14)
    else:
        rotation = [moved[key] for key in ("rx", "ry", "rz")]
        assert rotation == pytest.approx(sign * np.array(step), abs=1e-14)


def numbers(rng, free):
    """Return an error, a clearance, and a full stiffness matrix with a free motion."""
    root = rng.normal(size=(6, 6))
    K = (root @ root.T + 6 * np.eye(6)) * 1e5
    K[free] = K[:, free] = 0.0
    play = Clearance(radial=1e-5, tilt=1e-4)
    return JointNumbers(play, K, rng.normal(size=6) * 1e-4)


@pytest.mark.parametrize("kind", ["revolute", "prismatic", "helical"])
def test_joint_with_exchanged_bodies_is_equivalent(kind):
    """The z axis of the second joint is reversed, so y and z components change."""
    rng = np.random.default_rng(5)
    given = numbers(rng, 5 if kind == "prismatic" else 2)
    signs = np.array([1, -1, -1, 1, -1, -1])
    other = JointNumbers(
        given.clearance, given.stiffness * np.outer(signs, signs), -signs * given.error
    )
    here = joint(kind, numbers=(given,))
    across = here.across
    there = DrawnJoint("j", kind, "table", "base", AT, -AXIS, across, across,
                       pitch=here.pitch, numbers=(other,))  # fmt: skip
    point = np.array([0.7, 0.3, 0.1])
    held = joint("spherical", name="ball", at=point)
    # both joints have the base as second body
    back = joint("spherical", "table", "base", "ball", point)
    robots = robot(here, held), robot(there, back)
    assert robots[1].frame("j").parent == BASE
    found = [solve_assembly(home_posture(one)) for one in robots]
    assert found[0].energy > 1e-6
    assert found[1].energy == pytest.approx(found[0].energy, rel=1e-12)
    np.testing.assert_allclose(
        found[1].platform_screw, found[0].platform_screw, rtol=0, atol=1e-15
    )


@pytest.mark.parametrize("kind", FREE)
def test_joint_error_is_in_joint_axes(kind):
    """The platform screw is the transformed error, independent of the joint type."""
    error = np.array([1e-4, -2e-4, 3e-4, 1e-5, -2e-5, 3e-5])
    drawn = robot(
        joint(kind, numbers=(JointNumbers(error=error, tolerance=2 * abs(error)),))
    )
    at = home_posture(drawn)
    found = linearise(at).platform @ drawn.errors.ravel()
    expected = screw_map(AT - at.platform[:3, 3], axes()) @ error
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-18)
    sizes = [f.tolerance for f in drawn.frames if f.tolerance is not None]
    assert [sorted(size) for size in sizes] == [sorted(2 * abs(error))]


def test_bearing_error_is_in_bearing_axes():
    """In a universal joint, z is the axis of the bearing."""
    errors = np.diag(np.arange(1, 7) * 1e-5)[[0, 5]]
    both = tuple(JointNumbers(error=error) for error in errors)
    drawn = robot(joint("universal", numbers=both))
    at = home_posture(drawn)
    found = linearise(at).platform @ drawn.errors.ravel()
    expected = np.zeros(6)
    for z, x, error in ((AXIS, AXIS2, errors[0]), (AXIS2, AXIS, errors[1])):
        across = perpendicular(z, x)
        turn = np.column_stack([across, np.cross(z, across), z])
        expected += screw_map(AT - at.platform[:3, 3], turn) @ error
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-18)


@pytest.mark.parametrize("kind", ["spherical", "cylindrical", "planar"])
def test_platform_stiffness_equals_stiffness_of_compound_joint(kind):
    """The platform stiffness equals the joint stiffness."""
    K = np.array([2e3, 3e3, 5e3, 2e6, 3e6, 5e6])
    free = {"spherical": [0, 1, 2], "cylindrical": [2, 5], "planar": [2, 3, 4]}[kind]
    K[free] = 0.0
    drawn = robot(joint(kind, numbers=(JointNumbers(stiffness=np.diag(K)),)))
    found = platform_stiffness(home_posture(drawn))
    M = screw_map(AT - home_posture(drawn).platform[:3, 3], axes())
    stiff = np.linalg.inv(M).T @ np.diag(K) @ np.linalg.inv(M)
    size = np.sqrt(np.diag(stiff))
    assert np.abs((found.stiffness - stiff) / np.outer(size, size)).max() < 1e-12


def test_link_stiffness_does_not_depend_on_its_start():
    """The stiffness matrix is specified at either of the two joints."""
    rng = np.random.default_rng(3)
    root = rng.normal(size=(6, 6))
    K = (root @ root.T + 6 * np.eye(6)) * 1e5
    far = np.array([0.5, 0.1, -0.2])
    M = screw_map(axes().T @ (AT - far), np.eye(3))
    links = [(K, ("a", "b")), (M.T @ K @ M, ("b", "a"))]
    ends = (joint("revolute", "base", "rod", "a", actuated=True),
            joint("revolute", "rod", "table", "b", far, actuated=True))  # fmt: skip
    found = []
    for stiffness, between in links:
        link = {"rod": {"link": MatrixLink(stiffness), "ends": between}}
        drawn = robot(*ends, bodies=("rod", "table"), links=link)
        found.append(platform_stiffness(home_posture(drawn)).stiffness)
    size = np.sqrt(np.diag(found[0]))
    assert np.abs((found[1] - found[0]) / np.outer(size, size)).max() < 1e-12


@pytest.mark.parametrize(
    ("name", "reverse"),
    [("bar.link", True), ("bar.end", True), ("d.end", False), ("d.base", False)],
)
def test_results_do_not_depend_on_body_names(name, reverse):
    """The loop of a four-bar linkage is closed at its elastic bar or at the base."""

    def compliance(name):
        link = {"link": MatrixLink(1e6 * np.eye(6)), "ends": ("b", "c")}
        ends = [("base", "crank"), ("crank", "bar"), ("bar", name), (name, "base")]
        a, b, c, d = (e[::-1] if reverse and e[0] != "base" else e for e in ends)
        pins = [
            pin("a", *a, 0.0, actuated=True), pin("b", *b, 0.1), pin("c", *c, 0.2),
            pin("d", *d, 0.3),
        ]  # fmt: skip
        drawn = robot(*pins, bodies=("crank", "bar", name), platform=name,
                      links={"bar": link, name: {"mass": 1.0}})  # fmt: skip
        return platform_stiffness(home_posture(drawn)).compliance

    np.testing.assert_allclose(compliance(name), compliance("rocker"), atol=1e-15)


def pin(name, first, second, x, **more):
    z, x_axis = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    at = np.array([x, x * (0.3 - x), 0.0])
    return DrawnJoint(name, "revolute", first, second, at, z, x_axis, x_axis, **more)
