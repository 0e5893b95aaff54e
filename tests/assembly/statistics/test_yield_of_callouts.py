"""Yields of callouts compared with an independent nonlinear simulation."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forcefit.assembly.callouts.callout import Callout, Datum
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.assembly.statistics.callout_sources import sources_of
from forcefit.assembly.statistics.estimates import proportion
from forcefit.assembly.statistics.linear_response import linear_response
from tests.drawn_four_bar_for_tests import four_bar_file

FINITE, LINEAR = 1_000_000, 20_000


def disc(rng, radius):
    """Return uniform random points in a disc."""
    points = rng.uniform(-1, 1, (int(1.4 * FINITE) + 1000, 2))
    return radius * points[np.hypot(*points.T) <= 1][:FINITE]


# arm with a bore perpendicular to its first axis
TURN = np.array([0.0, np.pi / 2, 0.0])
ARM = Robot(
    "arm",
    "tip",
    (
        Frame("first", joint="revolute", actuated=True, position=0.3),
        Frame("bore", "first", np.array([0.4, 0.1, 0.05]), TURN, joint="revolute",
              actuated=True, position=-0.8),
        Frame("tip", "bore", np.array([0.2, -0.1, 0.15])),
    ),
)  # fmt: skip


def moved_arm(rng, width, length):
    """Return displacements of the tip for random ends of the bore, (k, 3) [m]."""
    ends = disc(rng, width / 2), disc(rng, width / 2)
    shift, slope = (ends[0] + ends[1]) / 2, (ends[0] - ends[1]) / length
    # rotation from z to the tilted axis
    axis = np.column_stack([slope, np.ones(len(slope))])
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    normal = np.cross([0.0, 0.0, 1.0], axis)
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    turn = Rotation.from_rotvec(normal / np.maximum(size, 1e-300) * np.arcsin(size))
    hand = Rotation.from_rotvec([0, 0, -0.8]).apply([0.2, -0.1, 0.15])
    own = np.column_stack([shift, np.zeros(len(shift))]) + turn.apply(hand) - hand
    return own  # in the axes of the bore


def moved_four_bar(rng, tolerances):
    """Return displacements of a coupler point for random lengths, (k, 2) [m]."""
    a, b, c, d = (
        nominal + t * rng.uniform(-1, 1, FINITE)
        for nominal, t in zip((0.1, 0.25, 0.2, 0.3), tolerances, strict=True)
    )
    return _point(a, b, c, d) - _point(0.1, 0.25, 0.2, 0.3)


def _point(a, b, c, d):
    """Return the position of a coupler point for given link lengths, (k, 2)."""
    B = np.column_stack([a * np.cos(np.pi / 3), a * np.sin(np.pi / 3)])
    D = np.column_stack([d + 0 * a, 0 * a])
    along = D - B
    size = np.linalg.norm(along, axis=1)
    x = (b**2 - c**2 + size**2) / (2 * size)
    y = np.sqrt(b**2 - x**2)
    e = along / size[:, None]
    C = B + x[:, None] * e + y[:, None] * np.column_stack([-e[:, 1], e[:, 0]])
    u = (C - B) / np.linalg.norm(C - B, axis=1, keepdims=True)
    return B + 0.125 * u + 0.05 * np.column_stack([-u[:, 1], u[:, 0]])


def linear_sizes(robot, seed):
    """Return platform translations in the linear model, (k,) [m]."""
    sources = sources_of(robot)
    draws = linear_response(home_posture(robot)).solve(
        sources.errors(sources.draw(0, LINEAR, seed))
    )
    return np.linalg.norm(draws.platform_screw[:, 3:], axis=1)


@pytest.mark.slow
def test_yields_of_callouts_agree_with_nonlinear_simulation(write_file):
    """For 20 confidence intervals of 95 %, one is expected to fail. Four or more fail
    with a probability of 1.6 %.
    """
    four_bar = read_robot(write_file(four_bar_file()))
    inside = []
    for case in range(20):
        rng = np.random.default_rng([7, case])
        if case % 2:
            widths = rng.uniform(2e-5, 3e-4, 4)
            sizes = np.linalg.norm(moved_four_bar(rng, widths), axis=1)
            of = dict(zip(("crank", "coupler", "rocker", "base"), widths, strict=True))
            callouts = tuple(
                replace(c, length=(c.length[0], of[c.name.rpartition(" ")[2]]))
                for c in four_bar.callouts
            )
            robot = replace(four_bar, callouts=callouts)
        else:
            width, length = rng.uniform(5e-5, 5e-4), rng.uniform(0.01, 0.05)
            sizes = np.linalg.norm(moved_arm(rng, width, length), axis=1)
            callout = Callout(
                "bore", "bore", (Datum("first"),), extent=(length,),
                widths={"position": width},
            )  # fmt: skip
            robot = replace(ARM, callouts=(callout,))
        limit = np.quantile(sizes, rng.uniform(0.5, 0.99))
        share = np.mean(sizes <= limit)
        met = int((linear_sizes(robot, case) <= limit).sum())
        interval = proportion(met, LINEAR)
        inside.append(interval["lower"] <= share <= interval["upper"])
    assert sum(inside) >= 17, inside
