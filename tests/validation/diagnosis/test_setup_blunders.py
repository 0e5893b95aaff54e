"""Test the detection of set-up blunders, such as exchanged columns.

The commands, loads or readings of a built-in robot are changed.  The machine also has
errors of about 1 mm, which are not blunders.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forcefit.assembly.kinematics.posture import Posture, place_many, place_many_joints
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.robots import load_robot
from forcefit.validation.campaign.campaign import number_rows
from forcefit.validation.diagnosis.setup_blunders import setup_blunders
from tests.campaigns_for_tests import campaign_at

ROWS = 25
POINT = np.array([0.05, 0.02, 0.1])
DEVICE = Rotation.from_rotvec([0.3, -0.8, 1.9])  # rotation of the measuring device
SHIFT = np.array([2.0, -1.0, 0.5])


def placed(robot, q):
    """Return the postures for commands (R, drives)."""
    driven = [frame.actuated for frame in robot.frames]
    held = np.full((len(q), len(driven)), np.nan)
    held[:, driven] = q
    return place_many_joints(robot, held)[0]


class Machine:
    """A robot measured at random commands under random loads.

    Attributes:
        q: (R, drives) commands.
        loads: (R, 6) loads.
        points: measured positions in the axes of the device.
        turns: measured rotations in the axes of the device.
    """

    def __init__(self, rng, name="arm6", spread=0.5, unknown=False, noise=1e-5,
                 own=1e-3, force=100.0):  # fmt: skip
        self.robot, self.unknown, self.noise = load_robot(name), unknown, noise
        driven = [frame for frame in self.robot.frames if frame.actuated]
        home = np.array([frame.position for frame in driven])
        self.q = home + spread * rng.uniform(-1, 1, (ROWS, len(driven)))
        self.loads = force * rng.normal(size=(ROWS, 6)) * np.repeat([0.02, 1.0], 3)
        T, deviation = self.declared(self.q, self.loads)
        own = own * np.sin(3 * self.q[:, :3])  # errors of the machine
        turns = Rotation.from_rotvec(deviation[:, :3]).as_matrix() @ T[:, :3, :3]
        points = T[:, :3, 3] + T[:, :3, :3] @ POINT + deviation[:, 3:] + own
        points += noise * rng.normal(size=points.shape)
        R = DEVICE.as_matrix() if unknown else np.eye(3)
        self.points = points @ R.T + (SHIFT if unknown else 0)
        self.turns = R @ turns

    def declared(self, q, loads):
        """Return the platform poses and the deviations of the declared robot."""
        postures = placed(self.robot, q)
        transforms = np.array([p.transforms for p in postures])
        coordinates = np.array([p.coordinates for p in postures])
        posture = Posture(self.robot, coordinates, transforms, 0.0)
        deviation = predict(as_declared(posture, loads, point=POINT)).deviation
        return transforms[:, self.robot.index(self.robot.platform)], deviation

    def campaign(self, rotations=False):
        """Return a campaign of the machine with its current commands and readings."""
        postures = placed(self.robot, self.q)
        transforms = np.array([p.transforms for p in postures])
        T = transforms[:, self.robot.index(self.robot.platform)]
        gap = Rotation.from_matrix(self.turns @ np.swapaxes(T[:, :3, :3], 1, 2))
        turned = gap.as_rotvec() if rotations else np.full((ROWS, 3), np.nan)
        shift = self.points - T[:, :3, 3] - T[:, :3, :3] @ POINT
        kinds = number_rows(np.array([p.coordinates for p in postures]))
        return campaign_at(
            self.robot, postures, np.hstack([turned, shift]),
            np.repeat([1e-5, self.noise], 3), loads=self.loads, reference_point=POINT,
            registration="unknown" if self.unknown else "known",
            configuration=kinds, repeat=kinds,
        )  # fmt: skip


def found(campaign):
    """Return the set-up blunders of a campaign."""
    posture = Posture(campaign.robot, campaign.coordinates, campaign.transforms, 0.0)
    conditions = as_declared(posture, campaign.loads, point=campaign.reference_point)
    return setup_blunders(campaign, conditions)


def said(campaign):
    """Return the kinds and columns of the reported blunders."""
    return {(one.kind, one.columns) for one in found(campaign)}


@pytest.mark.parametrize("unknown", [False, True])
@pytest.mark.parametrize("joint", range(6))
def test_reversed_joint_is_reported(rng, joint, unknown):
    machine = Machine(rng, unknown=unknown)
    machine.q[:, joint] *= -1
    (one,) = found(machine.campaign())
    assert (one.kind, one.columns) == ("sign", (f"q.joint{joint + 1}",))
    assert f"q.joint{joint + 1} fits with its sign reversed" in one.sentence
    assert one.after < 0.5 * one.before


@pytest.mark.parametrize("joint", [1, 2, 4])
@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_joint_offset_by_quarter_turns_is_reported(rng, joint, quarters):
    machine = Machine(rng, unknown=True)
    machine.q[:, joint] -= quarters * np.pi / 2
    (one,) = found(machine.campaign())
    assert (one.kind, one.columns) == ("quarter_turn", (f"q.joint{joint + 1}",))
    assert f"with {(90, 180, -90)[quarters - 1]} degrees added" in one.sentence


def test_quarter_turn_of_joint_1_requires_a_known_device_pose(rng):
    machine = Machine(rng, unknown=True, force=0.0)
    machine.q[:, 0] += np.pi / 2
    assert said(machine.campaign()) == set()
    known = Machine(rng, force=0.0)
    known.q[:, 0] += np.pi / 2
    assert said(known.campaign()) == {("quarter_turn", ("q.joint1",))}


@pytest.mark.parametrize("pair", [(0, 1), (1, 2), (3, 5)])
def test_exchanged_joints_are_reported(rng, pair):
    machine = Machine(rng, unknown=True)
    machine.q[:, list(pair)] = machine.q[:, list(pair)[::-1]]
    names = tuple(f"q.joint{k + 1}" for k in pair)
    assert said(machine.campaign()) == {("exchanged", names)}


def test_two_blunders_are_both_reported(rng):
    machine = Machine(rng, unknown=True)
    machine.q[:, 1] *= -1
    machine.q[:, 3] += np.pi / 2
    expected = {("sign", ("q.joint2",)), ("quarter_turn", ("q.joint4",))}
    assert said(machine.campaign()) == expected


LOADS = tuple(f"load.{c}" for c in ("mx", "my", "mz", "fx", "fy", "fz"))


@pytest.mark.parametrize(
    ("factor", "kind", "words"),
    [(-1, "sign", "with their signs reversed"), (1 / 9.81, "unit", "times 9.81"),
     (9.81, "unit", "times 0.1019"), (1e-3, "unit", "times 1000"),
     (1e3, "unit", "times 0.001")],
)  # fmt: skip
def test_loads_with_a_wrong_sign_or_unit_are_reported(rng, factor, kind, words):
    machine = Machine(rng, force=1e3, unknown=True)
    machine.loads = factor * machine.loads
    (one,) = found(machine.campaign())
    assert (one.kind, one.columns) == (kind, LOADS)
    assert words in one.sentence


@pytest.mark.parametrize(
    ("factor", "words"),
    [(25.4, "times 0.03937"), (1 / 25.4, "times 25.4"), (1e3, "times 0.001"),
     (1e-3, "times 1000")],
)  # fmt: skip
def test_measured_positions_in_a_wrong_unit_are_reported(rng, factor, words):
    machine = Machine(rng, unknown=True)
    machine.points = factor * machine.points
    (one,) = found(machine.campaign())
    assert (one.kind, one.columns) == ("unit", ("meas.tx", "meas.ty", "meas.tz"))
    assert f"{words}, as positions" in one.sentence


ROTATIONS = ("meas.rx", "meas.ry", "meas.rz")


@pytest.mark.parametrize(
    ("change", "kind", "words"),
    [
        (lambda R: R.inv(), "transposed", "transposed, as orientations"),
        # A quaternion (x, y, z, w) is read in the order w, x, y, z.
        (lambda R: Rotation.from_quat(R.as_quat()[:, [1, 2, 3, 0]]),
         "quaternion", "w taken last, not first"),
        (lambda R: Rotation.from_quat(R.as_quat()[:, [3, 0, 1, 2]]),
         "quaternion", "w taken first, not last"),
    ],
)  # fmt: skip
def test_misread_rotations_are_reported(rng, change, kind, words):
    machine = Machine(rng)
    machine.turns = change(Rotation.from_matrix(machine.turns)).as_matrix()
    (one,) = found(machine.campaign(rotations=True))
    assert (one.kind, one.columns) == (kind, ROTATIONS)
    assert words in one.sentence


@pytest.mark.parametrize(
    "name",
    ["arm6", "3rrr", *(pytest.param(n, marks=pytest.mark.slow)
                       for n in ("delta", "hexapod"))],
)  # fmt: skip
@pytest.mark.parametrize("unknown", [False, True])
def test_inaccurate_machine_has_no_reported_blunder(rng, name, unknown):
    """The machine has errors of about 1 mm, which is 100 sigma."""
    machine = Machine(rng, name, spread=0.005, unknown=unknown)
    assert said(machine.campaign(rotations=True)) == set()


@pytest.mark.slow
def test_reversed_drive_of_a_delta_robot_is_reported(rng):
    """The second drive has the opposite sign."""
    machine = Machine(rng, "delta", spread=0.05)
    machine.q[:, 1] *= -1
    (name,) = [f"q.{f.name}" for f in machine.robot.frames if f.actuated][1:2]
    assert said(machine.campaign()) == {("sign", (name,))}


def test_reversed_joint_is_reported_despite_outliers(rng):
    machine = Machine(rng)
    machine.q[:, 2] *= -1
    machine.points[[3, 17]] += 5.0
    assert said(machine.campaign()) == {("sign", ("q.joint3",))}


def test_accurate_machine_has_no_reported_blunder(rng):
    assert found(Machine(rng, own=0.0).campaign()) == ()


def test_missing_compliance_is_not_reported_as_a_wrong_unit(rng):
    """The declared drives are compliant, but the machine is rigid."""
    machine = Machine(rng, force=1e3)
    T, _ = machine.declared(machine.q, machine.loads)
    machine.points = T[:, :3, 3] + T[:, :3, :3] @ POINT
    assert said(machine.campaign()) == set()


def test_reversed_joint_is_reported_if_only_tz_is_measured(rng):
    machine = Machine(rng)
    machine.q[:, 2] *= -1
    machine.points[:, :2] = np.nan
    assert said(machine.campaign()) == {("sign", ("q.joint3",))}


def commanded_by_pose(machine, change):
    """Return a campaign of a machine with changed pose commands."""
    T, _ = machine.declared(machine.q, machine.loads)
    turns = Rotation.from_matrix(T[:, :3, :3])
    postures, _ = place_many(machine.robot, change(T[:, :3, 3], turns))
    campaign = machine.campaign(rotations=True)
    given = np.array([p.transforms for p in postures])
    nominal = given[:, machine.robot.index(machine.robot.platform)]
    gap = Rotation.from_matrix(
        machine.turns @ np.swapaxes(nominal[:, :3, :3], 1, 2)
    ).as_rotvec()
    shift = machine.points - nominal[:, :3, 3] - nominal[:, :3, :3] @ POINT
    return replace(
        campaign,
        commanded="pose",
        coordinates=np.array([p.coordinates for p in postures]),
        transforms=given,
        measured=np.hstack([gap, shift]),
    )


@pytest.mark.slow
def test_transposed_commanded_rotations_are_reported(rng):
    machine = Machine(rng, "hexapod", spread=0.01)
    campaign = commanded_by_pose(
        machine, lambda p, R: np.hstack([p, R.inv().as_rotvec()])
    )
    expected = {("transposed", ("pose.rx", "pose.ry", "pose.rz"))}
    assert said(campaign) == expected
    right = commanded_by_pose(machine, lambda p, R: np.hstack([p, R.as_rotvec()]))
    assert said(right) == set()


@pytest.mark.slow
def test_commanded_positions_in_a_wrong_unit_are_reported(rng):
    """The commanded positions are 25.4 times too large."""
    machine = Machine(rng, "hexapod", spread=0.01)

    def change(p, R):
        return np.hstack([p * 25.4, R.as_rotvec()])

    (one,) = found(commanded_by_pose(machine, change))
    assert (one.kind, one.columns) == ("unit", ("pose.tx", "pose.ty", "pose.tz"))
    assert "times 0.03937" in one.sentence


def test_reversed_joint_is_reported_if_only_rotations_are_measured(rng):
    """The pose of the measuring device differs between two sessions."""
    machine = Machine(rng, unknown=True)
    machine.q[:, 4] *= -1
    first = np.arange(ROWS) < 12
    machine.turns[~first] = DEVICE.as_matrix() @ machine.turns[~first]
    campaign = machine.campaign(rotations=True)
    turns = np.where(np.arange(6) < 3, campaign.measured, np.nan)
    session = np.where(first, "monday", "tuesday")
    both = replace(campaign, measured=turns, session=session)
    assert said(both) == {("sign", ("q.joint5",))}
