"""The paper's robot with errors, and terms of the model broken for one test."""

from functools import partial

import pytest

from assembly.kinematics.posture import place_robot
from assembly.robots import load_robot
from tests.robots_for_tests import with_papers_errors


@pytest.fixture(scope="module")
def irsbot2():
    return with_papers_errors(load_robot("irsbot2"), seed=1)


@pytest.fixture(scope="module")
def posture(irsbot2):
    return place_robot(irsbot2, {"tx": 0.0, "tz": -0.5})


@pytest.fixture
def broken(monkeypatch):
    """Break a term of the numpy model, and clear cached columns.

    The compiled model has each term a second time.
    """
    from assembly.linear.closure import _virtual_joints
    from assembly.linear.energy import solve_assembly
    from validation.crosscheck import crosscheck

    def breaks(mutation):
        mutation(monkeypatch)
        reference = partial(solve_assembly, method="reference")
        monkeypatch.setattr(crosscheck, "solve_assembly", reference)
        _virtual_joints.cache_clear()

    yield breaks
    _virtual_joints.cache_clear()
