"""Small robots with errors, and plans for tolerance allocation."""

from dataclasses import replace

import numpy as np

from forcefit.assembly.callouts.callout import Callout, Datum
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.model.robot import Clearance, Frame, MatrixLink, Robot
from forcefit.assembly.statistics.requirement import Plan

PLAY = 1e-4  # [m] radial clearance
ARM = 0.4  # [m] distance from the pin to the tip of the arm


def arm(passive=False, joint="revolute", link=None, **clearance):
    """Return an arm with one joint, whose tip is at a distance from the joint axis."""
    frames = (
        Frame("pin", joint=joint, actuated=not passive,
              clearance=Clearance(**clearance) if clearance else None),
        Frame("tip", "pin", [ARM, 0, 0], link=link),
    )  # fmt: skip
    return Robot("arm", "tip", frames)


def rigid_pair(**clearance):
    """Return two rigid bodies with a common point, with a clearance if given."""
    frames = (
        Frame("one", translation=[0.5, 0, 0]),
        Frame("two", "base", [0.5, 0, 0]),
        Frame("end", "one", clearance=Clearance(**clearance) if clearance else None),
    )
    return Robot("rigid", "end", frames, (("end", "two"),))


def pairs_of_bars(stiffnesses, radial=None):
    """Return independent pairs of elastic bars, each with a common end."""
    frames, closures = [], []
    for i, k in enumerate(stiffnesses):
        link = MatrixLink(np.eye(6) * k)
        clearance = None if radial is None else Clearance(radial=radial)
        frames += [
            Frame(f"one{i}", translation=[0.5, 0, 0], link=link),
            Frame(f"two{i}", translation=[0.5, 0, 0], link=link),
            Frame(f"joint{i}", f"one{i}", clearance=clearance),
        ]
        closures.append((f"joint{i}", f"two{i}"))
    return Robot("pairs", "joint0", tuple(frames), tuple(closures))


def silent(*_):
    """Show no progress."""


def drawn_errors(robot, scale=1.0, count=6):
    """Return random errors within 1e-3 rad and 1e-4 m times a scale.

    The shape is (count, frames, 6).
    """
    sources = tolerance_sources(robot, scale * np.array([1e-3] * 3 + [1e-4] * 3))
    return sources.errors(sources.draw(0, count, seed=4))


def plan_for(robot, places, costs, limits, **options):
    """Return a plan with a separate tolerance for each ``(frame, component)``."""
    some = tolerance_sources(robot, [1.0] * 6, tuple({f for f, _ in places}))
    keys = [
        (robot.frames[i].name, c)
        for i, c in zip(some.frame, some.component, strict=True)
    ]
    kept = [keys.index(place) for place in places]
    arrays = ("frame", "component", "kind", "centre", "scale", "least", "limit",
              "signed")  # fmt: skip
    sources = type(some)(robot, *(getattr(some, a)[kept] for a in arrays))
    count = len(places)
    return Plan(sources, np.arange(count), tuple(str(p) for p in places),
                np.array(costs, dtype=float), np.zeros(count), np.full(count, 0.01),
                limits, **options)  # fmt: skip


def two_links(first=0.5, bend=0.8, hand=20e-6, shoulder=None, elbow=None):
    """Driven arm of 0.4 and 0.3 m, whose link lengths have callouts."""
    frames = (
        Frame("shoulder", joint="revolute", actuated=True, position=first,
              clearance=shoulder),
        Frame("elbow", "shoulder", np.array([0.4, 0, 0]), joint="revolute",
              actuated=True, position=bend, clearance=elbow),
        Frame("tip", "elbow", np.array([0.3, 0, 0])),
    )  # fmt: skip
    callouts = (
        Callout("arm", "elbow", (Datum("shoulder"),), length=(0.4, 50e-6)),
        Callout("hand", "tip", (Datum("elbow"),), length=(0.3, hand)),
    )
    return Robot("arm", "tip", frames, callouts=callouts)


def parallel(k1, k2):
    """Platform between two bars along x of stiffness k1 and k2."""
    frames = (
        Frame("one", translation=[0.5, 0, 0], link=MatrixLink(np.eye(6) * k1)),
        Frame("mount", translation=[1.0, 0, 0]),
        Frame("two", "mount", [-0.5, 0, 0], link=MatrixLink(np.eye(6) * k2)),
    )
    return Robot("parallel", "one", frames, (("one", "two"),))


def without_clearances(robot):
    """The robot with ideal joints."""
    return replace(
        robot, frames=tuple(replace(f, clearance=None) for f in robot.frames)
    )
