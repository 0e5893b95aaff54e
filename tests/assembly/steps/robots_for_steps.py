"""Robots for the tests of assembly in steps."""

import numpy as np

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import BeamLink, Frame, MatrixLink, Robot
from forcefit.stiffness.screws import rotation_vector

STIFF = 1e9  # [N m/rad, N/m] stiffness of all other directions


def spring(k, component):
    """Return a link with stiffness k along one component."""
    diagonal = np.full(6, STIFF)
    diagonal[component] = k
    return MatrixLink(np.diag(diagonal))


def leg(name, k, error, s=0.0, clearance=None):
    """Return a leg at x = s that is elastic along z, or rigid if k is None."""
    return Frame(
        name, "base", translation=[s, 0, 0], clearance=clearance,
        link=None if k is None else spring(k, 5),
        geometric_error=[0, 0, 0, 0, 0, error],
    )  # fmt: skip


def guided(legs, name="legs"):
    """Return a platform that moves along z, and the legs to which it is joined."""
    guide = (Frame("guide", "base", joint="prismatic"), Frame("platform", "guide"))
    closures = tuple(("platform", leg.name) for leg in legs)
    return home_posture(Robot(name, "platform", (*guide, *legs), closures))


def three_legs():
    """Return a platform that moves along z, with three elastic legs."""
    legs = zip((1e6, 2e6, 3e6), (30e-6, -20e-6, 50e-6), strict=True)
    return guided([leg(f"leg{i}", k, d) for i, (k, d) in enumerate(legs, 1)])


Y_AXIS = rotation_vector(np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]))


def planar_platform(places, errors, k=1e6):
    """Return a platform that moves along z and about y, with legs at x = places."""
    frames = [
        Frame("guide", "base", joint="prismatic"),
        Frame("turn", "guide", rotation=Y_AXIS, joint="revolute"),
        Frame("platform", "turn", rotation=-Y_AXIS),
    ]
    closures = []
    for i, (s, error) in enumerate(zip(places, errors, strict=True), 1):
        frames += [
            leg(f"leg{i}", k, error, s),
            Frame(f"pin{i}", f"leg{i}", rotation=Y_AXIS, joint="revolute"),
            Frame(f"end{i}", f"pin{i}", rotation=-Y_AXIS),
            Frame(f"seat{i}", "platform", translation=[s, 0, 0]),
        ]
        closures.append((f"seat{i}", f"end{i}"))
    return home_posture(Robot("planar", "platform", tuple(frames), tuple(closures)))


def two_bars(gap):
    """Return two collinear bars between two walls, with a gap because of an error."""
    frames = (
        Frame("bar1", "base", translation=[0, 0, 0.5], link=spring(1e6, 5)),
        Frame("joint", "bar1", geometric_error=[0, 0, 0, 0, 0, -gap]),
        Frame("bar2", "joint", translation=[0, 0, 0.5], link=spring(3e6, 5)),
        Frame("wall", "base", translation=[0, 0, 1.0]),
    )
    return home_posture(Robot("two bars", "bar2", frames, (("wall", "bar2"),)))


def portal():
    """Return a portal frame of beams on a base beam."""

    def bar(width, height, up):
        I = {"I_y": width * height**3 / 12, "I_z": width**3 * height / 12, "J": 1e-6}
        section = {"area": 10.0, "shear_y": 1.0, "shear_z": 1.0} | I
        return BeamLink(section, 2.1e11, 0.3, theory="euler", up=up)

    wide = bar(0.06, 0.03, (0.0, 0.0, 1.0))
    thin = bar(0.03, 0.03, (0.0, 1.0, 0.0))
    frames = (
        Frame("x", "base", rotation=[0, np.pi / 2, 0], joint="prismatic"),
        Frame("z", "x", rotation=[0, -np.pi / 2, 0], joint="prismatic"),
        Frame("turn", "z", rotation=Y_AXIS, joint="revolute"),
        Frame("foot1", "turn", rotation=-Y_AXIS),
        Frame("foot2", "foot1", translation=[0.6, 0, 0], link=wide),
        Frame("top1", "foot1", translation=[0, 0, 0.4], link=thin),
        Frame("corner", "top1", translation=[0.6, 0, 0], link=thin),
        Frame("top2", "foot2", translation=[0, 0, 0.4], link=thin),
    )
    return home_posture(Robot("portal", "top1", frames, (("corner", "top2"),)))


def gough_points():
    """Return the joint centres of a Gough platform on base and platform, (6, 3)."""
    low = np.radians([-10, 10, 110, 130, 230, 250])
    high = np.radians([310, 50, 70, 170, 190, 290])
    base = np.c_[0.5 * np.cos(low), 0.5 * np.sin(low), np.zeros(6)]
    top = np.c_[0.25 * np.cos(high), 0.25 * np.sin(high), np.full(6, 0.5)]
    return base, top
