"""Import of Pinocchio models from memory, compared with Pinocchio's kinematics."""

import numpy as np
import pytest

import forcefit as ff
from forcefit.assembly.exchange.mechanism import body_poses
from forcefit.assembly.exchange.mjcf import read_mjcf
from forcefit.assembly.exchange.pinocchio_model import mjcf_of_pinocchio
from forcefit.inputs.errors import BadInput

pinocchio = pytest.importorskip("pinocchio", reason="Pinocchio is not installed")


def place(rng):
    turn = pinocchio.utils.rotate("z", rng.uniform(-3, 3))
    tilt = pinocchio.utils.rotate("x", rng.uniform(-3, 3))
    return pinocchio.SE3(turn @ tilt, rng.uniform(-0.5, 0.5, 3))


def every_kind():
    """Return a tree with revolute and prismatic joints of various types."""
    rng, model = np.random.default_rng(4), pinocchio.Model()
    model.name, axis = "tree", np.array([0.6, 0.0, 0.8])
    kinds = (
        pinocchio.JointModelRX(), pinocchio.JointModelRevoluteUnaligned(axis),
        pinocchio.JointModelPY(), pinocchio.JointModelPrismaticUnaligned(axis),
        pinocchio.JointModelRUBZ(), pinocchio.JointModelRZ(),
    )  # fmt: skip
    parent = 0
    for number, kind in enumerate(kinds):
        limit = np.array([1.5])
        q = np.full(kind.nq, 1.5)
        parent = model.addJoint(
            parent if number != 3 else 1, kind, place(rng), f"j{number}", limit, limit,
            -q, q,
        )  # fmt: skip
        mass = pinocchio.Inertia(2.0, rng.uniform(-0.1, 0.1, 3), np.diag([1, 2, 2.5]))
        model.appendBodyToJoint(parent, mass, pinocchio.SE3.Identity())
        model.addBodyFrame(f"link{number}", parent, pinocchio.SE3.Identity(), 0)
    model.addBodyFrame("tool", parent, place(rng), 0)
    return model


def read(model, folder):
    (folder / "model.xml").write_text(mjcf_of_pinocchio(model))
    return read_mjcf(folder / "model.xml")


@pytest.mark.parametrize(
    "make", [every_kind, lambda: pinocchio.buildSampleModelManipulator()]
)
def test_body_poses_agree_with_pinocchio(make, tmp_path):
    model, rng = make(), np.random.default_rng(1)
    mechanism, data = read(model, tmp_path), model.createData()
    row = {joint.name: k for k, joint in enumerate(mechanism.joints)}
    for _ in range(20):
        q, own = pinocchio.neutral(model), np.zeros(len(mechanism.joints))
        for joint, name in zip(model.joints[1:], list(model.names)[1:], strict=True):
            own[row[name]] = value = rng.uniform(-1.5, 1.5)
            both = [np.cos(value), np.sin(value)]
            q[joint.idx_q : joint.idx_q + joint.nq] = both if joint.nq == 2 else value
        pinocchio.framesForwardKinematics(model, data, q)
        poses = body_poses(mechanism, own)
        named = [k for k, f in enumerate(model.frames) if f.name in poses]
        assert len(named) >= model.njoints - 1
        for k in named:
            np.testing.assert_allclose(
                poses[model.frames[k].name], data.oMf[k].homogeneous, atol=1e-12
            )


def test_masses_and_joint_limits_agree_with_pinocchio(tmp_path):
    mechanism = read(every_kind(), tmp_path)
    model = every_kind()
    for number in range(6):
        body, own = mechanism.bodies[f"link{number}"], model.inertias[number + 1]
        assert body.mass == own.mass
        np.testing.assert_allclose(body.centre, own.lever, atol=1e-15)
        np.testing.assert_allclose(body.inertia, own.inertia, atol=1e-12)
    limits = {joint.name: joint.limits for joint in mechanism.joints}
    assert limits["j0"] == (-1.5, 1.5)
    assert limits["j4"] is None  # an unlimited revolute joint


def test_robot_from_pinocchio_model_equals_robot_from_urdf(tmp_path):
    ff.write_robot(ff.load_robot("arm6"), tmp_path / "arm6.urdf")
    by_file = ff.load_robot(tmp_path / "arm6.urdf")
    model = pinocchio.buildModelFromUrdf(str(tmp_path / "arm6.urdf"))
    robot = ff.load_robot(model)
    assert (
        "Model: taken: every joint with one degree of freedom as a drive"
        in robot.remarks
    )
    joints = {f.name: 0.2 for f in by_file.frames if f.actuated}
    assert sorted(joints) == sorted(f.name for f in robot.frames if f.actuated)
    np.testing.assert_allclose(
        ff.place_robot(robot, joints=joints).platform,
        ff.place_robot(by_file, joints=joints).platform, atol=1e-9,
    )  # fmt: skip


def test_pinocchio_model_with_planar_joint_is_rejected():
    model = pinocchio.Model()
    planar = pinocchio.JointModelPlanar()
    model.addJoint(0, planar, pinocchio.SE3.Identity(), "slab")
    with pytest.raises(BadInput, match='Model: joint "slab": found a JointModelPlanar'):
        ff.load_robot(model)
