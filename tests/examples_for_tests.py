"""Robots of others that tests read where they lie; a test without them is skipped."""

from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "shared" / "data" / "example_parallel_robots"


def example(name):
    """The URDF of an example, or a word why the test is skipped."""
    path = EXAMPLES / name / "robot.urdf"
    if not path.is_file():
        pytest.skip(f"no {path}: example_parallel_robots is not here")
    return path
