"""Comparison of the deflection along a path with a dynamic simulation by Exudyn."""

import exudyn as exu
import exudyn.itemInterface as item
import numpy as np
import pytest

from forcefit.assembly.model.robot import Frame, Robot
from forcefit.assembly.path.path_errors import path_errors
from forcefit.assembly.path.path_file import PathTable
from forcefit.assembly.path.profiles import PROFILES
from forcefit.assembly.path.trajectory import profiled
from tests.assembly.exact.test_exact import only
from tests.assembly.path.moving_robots_for_tests import hinge, rod

NEAR, FAR, FEET = 0.09, 0.11, ((-0.06, 0.0), (0.06, 0.0))
MASSES, TOOL = {"near": 0.2, "far": 0.15}, 0.5
START, END, DURATION = np.array([-0.02, 0.13]), np.array([0.025, 0.15]), 0.08


def arm_angles(tip, foot, side):
    """Return the angles of both arms of a leg to the x axis, by the law of cosines."""
    along = np.subtract(tip, foot)
    d, to_tip = np.hypot(*along), np.arctan2(along[1], along[0])
    inner = np.arccos((NEAR**2 + d**2 - FAR**2) / (2 * NEAR * d))
    near = to_tip + side * inner
    elbow = foot + NEAR * np.array([np.cos(near), np.sin(near)])
    far = np.arctan2(*(tip - elbow)[::-1])
    return near, far


def robot_of(stiffness):
    """Return a five-bar robot with rigid arms, elastic drives and a mass at its tip."""
    frames, angles = [], []
    for name, foot, side in (("left", FEET[0], 1), ("right", FEET[1], -1)):
        near, far = arm_angles(START, foot, side)
        angles.append(far)
        frames += [
            hinge(f"{name}.drive", at=[*foot, 0], position=near,
                  joint_stiffness=only(2, stiffness)),
            Frame(f"{name}.elbow", f"{name}.drive", [NEAR, 0, 0], joint="revolute",
                  position=far - near, **rod(MASSES["near"], NEAR)),
        ]  # fmt: skip
    frames += [
        Frame("left.pin", "left.elbow", [FAR, 0, 0], joint="revolute",
              position=float(angles[1] - angles[0]), **rod(MASSES["far"], FAR)),
        Frame("left.tip", "left.pin", mass=TOOL),
        Frame("right.tip", "right.elbow", [FAR, 0, 0], **rod(MASSES["far"], FAR)),
    ]  # fmt: skip
    return Robot("five_bar", "left.tip", tuple(frames), (("left.tip", "right.tip"),))


def simulated(stiffness, steps):
    """Return times and positions of the tip in a simulation by Exudyn."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    ground = mbs.AddObject(item.ObjectGround())

    def body(mass, length, start, angle):
        centre = start + length / 2 * np.array([np.cos(angle), np.sin(angle)])
        node = mbs.AddNode(item.NodeRigidBody2D(referenceCoordinates=[*centre, angle]))
        return node, mbs.AddObject(item.ObjectRigidBody2D(
            mass=mass, inertia=mass * length**2 / 12, nodeNumber=node
        ))  # fmt: skip

    def marker(number, place):
        return mbs.AddMarker(
            item.MarkerBodyPosition(bodyNumber=number, localPosition=place)
        )

    def pin(first, second):
        mbs.AddObject(item.ObjectJointRevolute2D(markerNumbers=[first, second]))

    def nominal(t):
        s = PROFILES["seventh"](np.array([min(t / DURATION, 1.0)]))[0][0]
        return START + s * (END - START)

    tips = []
    for foot, side in ((FEET[0], 1), (FEET[1], -1)):
        near, far = arm_angles(START, foot, side)
        arm, arm_body = body(MASSES["near"], NEAR, np.array(foot), near)
        elbow = foot + NEAR * np.array([np.cos(near), np.sin(near)])
        _, far_body = body(MASSES["far"], FAR, elbow, far)
        pin(marker(ground, [*foot, 0]), marker(arm_body, [-NEAR / 2, 0, 0]))
        pin(marker(arm_body, [NEAR / 2, 0, 0]), marker(far_body, [-FAR / 2, 0, 0]))
        tips.append(marker(far_body, [FAR / 2, 0, 0]))

        def torque(mbs, t, i, u, v, k, d, offset, foot=foot, side=side, near=near):
            return k * (u - (arm_angles(nominal(t), foot, side)[0] - near))

        still = mbs.AddNode(item.NodePointGround())
        ends = [mbs.AddMarker(item.MarkerNodeCoordinate(nodeNumber=n, coordinate=c))
                for n, c in ((still, 0), (arm, 2))]  # fmt: skip
        mbs.AddObject(item.ObjectConnectorCoordinateSpringDamper(
            markerNumbers=ends, stiffness=stiffness, springForceUserFunction=torque
        ))  # fmt: skip
    point = mbs.AddNode(item.NodePoint2D(referenceCoordinates=list(START)))
    tool = mbs.AddObject(item.ObjectMassPoint2D(mass=TOOL, nodeNumber=point))
    at_tool = marker(tool, [0, 0, 0])
    for tip in tips:
        pin(tip, at_tool)
    sensor = mbs.AddSensor(
        item.SensorNode(nodeNumber=point, storeInternal=True, writeToFile=False,
                        outputVariableType=exu.OutputVariableType.Position)
    )  # fmt: skip
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = steps
    settings.timeIntegration.endTime = DURATION
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
    settings.timeIntegration.newton.absoluteTolerance = 1e-9
    settings.timeIntegration.newton.relativeTolerance = 1e-8
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = DURATION / steps
    mbs.SolveDynamic(settings)
    data = mbs.GetSensorStoredData(sensor)
    container.Reset()
    return data[:, 0], data[:, 1:3]


@pytest.mark.slow
@pytest.mark.exudyn
def test_quasi_static_deflection_converges_to_dynamic_solution():
    """The error is proportional to 1 / (T f1)^2, where f1 is the first frequency."""
    table = PathTable(("tx", "ty"), np.array([START, END]))
    path = profiled(table, 101, "seventh", 1.0, duration=DURATION)
    left_out, periods = [], []
    for stiffness, steps in ((2e4, 2000), (8e4, 4000)):
        found = path_errors(robot_of(stiffness), path)
        times, positions = simulated(stiffness, steps)
        dynamic = np.stack([np.interp(path.times, times, p) for p in positions.T], 1)
        error = dynamic - path.values - found.inertial[:, 3:5]
        left_out.append(np.abs(error).max() / np.abs(found.inertial[:, 3:5]).max())
        periods.append(found.periods)
    assert periods[0] > 15
    assert left_out[1] < 0.005
    expected = (periods[0] / periods[1]) ** 2
    assert left_out[1] / left_out[0] == pytest.approx(expected, rel=0.2)
