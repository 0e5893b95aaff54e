"""Values of the variables of effects."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import place_robot, together
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.measurement.variables import variable
from forcefit.assembly.model.robot import Frame, Robot

ROWS = 4


@pytest.fixture
def rows(rng):
    """Return conditions of two drives with loads and covariates."""
    robot = Robot("arm", "tip", (
        Frame("turn", joint="revolute", actuated=True),
        Frame("slide", "turn", [0.4, 0.1, 0.2], joint="prismatic", actuated=True),
        Frame("tip", "slide", [0.1, 0, 0]),
    ))  # fmt: skip
    commands = rng.uniform(-1, 1, (ROWS, 2))
    placed = [place_robot(robot, joints={"turn": a, "slide": z}) for a, z in commands]
    postures = together(placed)
    known = {
        "temperature": rng.normal(size=ROWS), "time": [30.0, 10.0, 20.0, 5.0],
        "dust": rng.normal(size=ROWS), "session": ["b", "a", "b", "a"],
    }  # fmt: skip
    here = as_declared(postures, rng.normal(size=(ROWS, 6)), covariates=known)
    return here, commands, known


def test_variables_have_the_values_of_the_measurements(rows):
    """Unspecified quantities are NaN."""
    here, commands, known = rows
    expected = {"q.turn": commands[:, 0], "q.slide": commands[:, 1], "q.tip": [0.0] * 4}
    for k, name in enumerate(("mx", "my", "mz", "fx", "fy", "fz")):
        expected[f"load.{name}"] = here.load[:, k]
    expected["load.force"] = np.sqrt((here.load[:, 3:] ** 2).sum(axis=1))
    c, s = np.cos(commands[:, 0]), np.sin(commands[:, 0])
    expected["position.x"] = 0.5 * c - 0.1 * s
    expected["position.y"] = 0.5 * s + 0.1 * c
    expected["position.z"] = 0.2 + commands[:, 1]
    for name in ("temperature", "time"):
        expected[name] = expected[f"cov.{name}"] = known[name]
    expected["cov.dust"] = known["dust"]
    for name in ("approach", "cov.approach", "cov.wind"):
        expected[name] = [np.nan] * ROWS
    for name, values in expected.items():
        np.testing.assert_allclose(variable(here, name), values, atol=1e-12)
