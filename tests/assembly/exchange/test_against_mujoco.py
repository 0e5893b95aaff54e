"""Comparison of the forward kinematics of imported and exported files with MuJoCo."""

import re

import numpy as np
import pytest

from forcefit.assembly.exchange.convert import convert
from forcefit.assembly.exchange.mechanism import body_poses
from forcefit.assembly.exchange.mjcf import read_mjcf
from forcefit.assembly.exchange.urdf import read_urdf
from tests.examples_for_tests import example

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")


def largest_gap(model, mechanism, rng):
    """Return the largest difference between body poses in random postures."""
    data, worst = mujoco.MjData(model), 0.0
    for _ in range(20):
        q = rng.uniform(-1, 1, len(mechanism.joints))
        for joint, value in zip(mechanism.joints, q, strict=True):
            if joint.kind != "fixed":
                data.qpos[model.joint(joint.name).qposadr[0]] = value
        mujoco.mj_kinematics(model, data)
        poses = body_poses(mechanism, q)
        for i in range(1, model.nbody):
            T = poses[model.body(i).name]
            turn = data.xmat[i].reshape(3, 3) - T[:3, :3]
            worst = max(
                worst, np.abs(turn).max(), np.abs(data.xpos[i] - T[:3, 3]).max()
            )
    return worst


@pytest.mark.parametrize("name", ["irsbot2", "delta", "hexapod", "arm6"])
def test_kinematics_of_exported_mjcf_agree_with_mujoco(name, tmp_path, rng):
    path = tmp_path / "robot.xml"
    convert(name, path)
    model = mujoco.MjModel.from_xml_path(str(path))
    assert largest_gap(model, read_mjcf(path), rng) < 1e-13
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    # the weld constraints are satisfied in the home pose
    assert np.abs(data.efc_pos).max(initial=0.0) < 1e-12


@pytest.mark.parametrize("name", ["cassie_like", "robot_delta", "wl16_like"])
def test_kinematics_of_imported_urdf_agree_with_mujoco(name, rng):
    path = example(name)
    text = re.sub(r"<(visual|collision)>.*?</\1>", "", path.read_text(), flags=re.S)
    ours = '<mujoco><compiler fusestatic="false" balanceinertia="true"/></mujoco>'
    ours = ours.replace("/></m", ' boundmass="1e-6" boundinertia="1e-9"/></m')
    text = re.sub(r"(<robot[^>]*>)", rf"\1{ours}", text, count=1)
    model = mujoco.MjModel.from_xml_string(text)
    assert largest_gap(model, read_urdf(path), rng) < 1e-13
