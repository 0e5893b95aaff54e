"""Plans of tolerances that several tests use."""

import numpy as np

from assembly.model.error_distributions import tolerance_sources
from assembly.statistics.requirement import Plan

PLAY = 1e-4


def plan_for(robot, places, costs, limits, **options):
    """A class for each place ``(frame, component)``."""
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
