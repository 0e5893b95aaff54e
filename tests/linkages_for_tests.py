"""Planar linkages with closed-form kinematics."""

import math

import numpy as np

from forcefit.assembly.model.robot import Frame, Robot


def frame(name, parent="base", at=(0, 0, 0), turn=(0, 0, 0), **more):
    return Frame(name, parent, np.array(at, float), np.array(turn, float), **more)


def driven(position=0.0):
    return {"joint": "revolute", "actuated": True, "position": position}


def free(position=0.0, joint="revolute"):
    return {"joint": joint, "position": position}


CRANK, COUPLER, ROCKER, GROUND = 0.3, 0.7, 0.6, 0.8


def four_bar_angles(q, mode=1.0):
    """Return the coupler angle, the rocker angle and the end of the coupler."""
    elbow = np.array([CRANK * math.cos(q), CRANK * math.sin(q)])
    to_rocker = np.array([GROUND, 0.0]) - elbow
    far = float(np.hypot(*to_rocker))
    inner = (COUPLER**2 + far**2 - ROCKER**2) / (2 * COUPLER * far)
    coupler = math.atan2(to_rocker[1], to_rocker[0]) + mode * math.acos(inner)
    end = elbow + COUPLER * np.array([math.cos(coupler), math.sin(coupler)])
    return coupler, math.atan2(end[1], end[0] - GROUND), end


def four_bar(q=0.5, mode=1.0, order=None):
    """Return a planar four-bar linkage whose platform is the end of the coupler."""
    coupler, rocker, _ = four_bar_angles(q, mode)
    frames = [
        frame("crank", **driven(q)),
        frame("elbow", "crank", (CRANK, 0, 0), **free(coupler - q + 0.05)),
        frame("end", "elbow", (COUPLER, 0, 0)),
        frame("rocker", at=(GROUND, 0, 0), **free(rocker - 0.05)),
        frame("wrist", "rocker", (ROCKER, 0, 0), **free(coupler - rocker)),
        frame("seat", "wrist"),
    ]
    order = range(len(frames)) if order is None else order
    return Robot("bars", "end", tuple(frames[i] for i in order), (("end", "seat"),))


def five_bar():
    """Return a planar five-bar linkage with two driven proximal bars."""
    robot = []
    x, y, b, l1, l2 = 0.0, 0.5, 0.1, 0.35, 0.4
    for side, name in ((1, "right"), (-1, "left")):
        far = math.hypot(x - side * b, y)
        aim = math.atan2(y, x - side * b)
        q = aim - side * math.acos((far**2 + l1**2 - l2**2) / (2 * far * l1))
        elbow = np.array([side * b + l1 * math.cos(q), l1 * math.sin(q)])
        bend = math.atan2(y - elbow[1], x - elbow[0])
        robot += [
            frame(f"{name}.drive", at=(side * b, 0, 0), **driven(q)),
            frame(f"{name}.elbow", f"{name}.drive", (l1, 0, 0), **free(bend - q)),
            frame(f"{name}.pin", f"{name}.elbow", (l2, 0, 0), **free(-bend)),
            frame(f"{name}.tip", f"{name}.pin"),
        ]
    closure = (("right.tip", "left.tip"),)
    return Robot("five_bar", "right.tip", tuple(robot), closure)


SLIDER_CRANK = 0.2, 0.3  # [m] lengths of the crank and the rod


def slider_crank(angle, rod=None, error=0.0):
    """Return a slider-crank mechanism that is driven at the slider along x.

    Args:
        angle: angle of the crank from the x axis [rad].
        rod: stiffness of the rod, or None for a rigid rod.
        error: length error of the rod [m].
    """
    crank, length = SLIDER_CRANK
    down = math.asin(crank * math.sin(angle) / length)
    end = crank * math.cos(angle) + length * math.cos(down)
    frames = (
        Frame("crank", joint="revolute", position=angle),
        Frame("pin", "crank", [crank, 0, 0], joint="revolute", position=-down - angle),
        Frame("tip", "pin", [length, 0, 0], link=rod,
              geometric_error=[0, 0, 0, error, 0, 0]),
        Frame("slide", rotation=[0, math.pi / 2, 0], joint="prismatic", actuated=True,
              position=end),
        Frame("wrist", "slide", rotation=[0, -math.pi / 2, 0], joint="revolute",
              position=-down),
        Frame("end", "wrist"),
    )  # fmt: skip
    return Robot("slider", "tip", frames, (("tip", "end"),))
