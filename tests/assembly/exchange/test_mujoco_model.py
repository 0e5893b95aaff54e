"""Import of MuJoCo models from memory."""

import numpy as np
import pytest

import forcefit as ff
from forcefit.assembly.exchange.mjcf import read_mjcf
from forcefit.assembly.exchange.mujoco_model import mjcf_of_model
from forcefit.assembly.exchange.mujoco_reading import compare_here as compare
from forcefit.inputs.errors import BadInput
from tests.assembly.exchange.test_mjcf import KINDS, file_of

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")

# link lengths: crank 0.1 m; coupler, rocker and base 0.3 m
FOUR_BAR = """<compiler angle="radian"/><default><geom type="capsule" size="0.01"/>
    </default><worldbody>
    <body name="crank" euler="0 0 0.9"><joint name="drive" range="-3 3"/>
      <geom fromto="0 0 0 0.1 0 0"/>
      <body name="coupler" pos="0.1 0 0"><joint name="elbow"/>
        <geom fromto="0 0 0 0.3 0 0"/><site name="end" pos="0.3 0 0"/></body></body>
    <body name="rocker" pos="0.3 0 0" euler="0 0 1.6">
      <joint name="pivot" stiffness="2"/>
      <geom fromto="0 0 0 0.3 0 0"/><site name="top" pos="0.3 0 0"/></body></worldbody>
    <equality><connect name="pin" site1="end" site2="top"/></equality>
    <actuator><motor joint="drive"/></actuator>"""


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_robot_from_compiled_mujoco_model_agrees_with_mujoco(kind, tmp_path):
    """The model is converted to a file, and the robot is compared with the model."""
    path = file_of(tmp_path, KINDS[kind])
    model = mujoco.MjModel.from_xml_path(str(path))
    (tmp_path / "made.xml").write_text(mjcf_of_model(model))
    answer = compare(read_mjcf(tmp_path / "made.xml"), path)
    assert answer.why_not == ""
    assert answer.difference < 1e-12, answer.text()
    assert answer.bodies == model.nbody - 1


def test_mujoco_model_of_exported_robot_has_same_platform(tmp_path):
    """The platform is stored in a custom text of the MJCF file."""
    path = tmp_path / "delta.xml"
    ff.write_robot(ff.load_robot("delta"), path)
    robot = ff.load_robot(mujoco.MjModel.from_xml_path(str(path)))
    assert robot.platform == ff.load_robot(path).platform == "leg1.a_tip"
    height = {"tz": -0.8}
    found, read = (
        ff.place_robot(one, pose=height).pose() for one in (robot, ff.load_robot(path))
    )
    assert found == pytest.approx(read, abs=1e-9)


@pytest.mark.parametrize("kind", ["MjModel", "MjSpec"])
def test_robot_from_mujoco_model_equals_robot_from_file(kind, tmp_path):
    path = file_of(tmp_path, FOUR_BAR, "four_bar.xml")
    model = getattr(mujoco, kind)
    model = model.from_xml_path(str(path)) if kind == "MjModel" else model.from_file(
        str(path)
    )  # fmt: skip
    robot, read = ff.load_robot(model), ff.load_robot(path)
    assert [frame.name for frame in robot.frames] == [f.name for f in read.frames]
    assert robot.closures == read.closures
    for own, other in zip(robot.frames, read.frames, strict=True):
        assert (own.joint, own.actuated, own.limits) == (
            other.joint, other.actuated, other.limits,
        )  # fmt: skip
        assert own.mass == pytest.approx(other.mass)
        assert own.position == pytest.approx(other.position, abs=1e-9)
        np.testing.assert_allclose(own.translation, other.translation, atol=1e-12)
    by_model, by_file = (ff.place_robot(one) for one in (robot, read))
    np.testing.assert_allclose(by_model.transforms, by_file.transforms, atol=1e-9)
    # the rocker, from the pivot at x = 0.3 m to the pin, has a length of 0.3 m
    pin = by_model.transforms[robot.index(robot.closures[0][0]), :3, 3]
    assert np.hypot(pin[0] - 0.3, pin[1]) == pytest.approx(0.3)


def test_changes_of_a_mujoco_model_are_imported(tmp_path):
    """The length of the crank is doubled in the model."""
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{FOUR_BAR}</mujoco>")
    model.body_pos[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "coupler")] *= 2
    posture = ff.place_robot(ff.load_robot(model))
    elbow = posture.transforms[posture.robot.index("elbow"), :3, 3]
    assert np.linalg.norm(elbow) == pytest.approx(0.2)


def test_load_robot_rejects_an_object_of_another_type():
    with pytest.raises(
        BadInput, match=r"load_robot: found 3\.0 .* an MjModel, MjSpec or pinocchio"
    ):
        ff.load_robot(3.0)


def test_mujoco_model_with_flexible_body_is_rejected():
    spec = mujoco.MjSpec.from_string(
        """<mujoco><worldbody><flexcomp name="f" dim="1"
        type="grid" count="3 1 1" spacing="0.1 0.1 0.1"/></worldbody></mujoco>"""
    )
    with (
        pytest.warns(UserWarning, match="flex"),  # warning from MuJoCo
        pytest.raises(BadInput, match="found a flex .flexible body., expected rigid"),
    ):
        ff.load_robot(spec)
