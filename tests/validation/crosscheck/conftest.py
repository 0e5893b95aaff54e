"""Fixtures with the IRSBot-2 and with deliberately wrong terms of a model."""

import sys
from functools import lru_cache, partial

import pytest

from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.robots import load_robot
from tests.robots_for_tests import with_papers_errors

Cached = type(lru_cache(len))


@pytest.fixture(scope="module")
def irsbot2():
    return with_papers_errors(load_robot("irsbot2"), seed=1)


@pytest.fixture(scope="module")
def posture(irsbot2):
    return place_robot(irsbot2, {"tx": 0.0, "tz": -0.5})


@pytest.fixture
def broken(monkeypatch):
    """Return a function that applies a mutation to the numpy model.

    Caches are cleared, because robots with equal data share them.
    """
    from forcefit.assembly.linear.energy import solve_assembly
    from forcefit.validation.crosscheck import crosscheck

    def breaks(mutation):
        mutation(monkeypatch)
        reference = partial(solve_assembly, method="reference")
        monkeypatch.setattr(crosscheck, "solve_assembly", reference)
        forget()

    yield breaks
    forget()


def forget():
    """Clear the caches of all forcefit functions."""
    for name, module in list(sys.modules.items()):
        if name.startswith("forcefit."):
            for value in vars(module).values():
                if isinstance(value, Cached):
                    value.cache_clear()
