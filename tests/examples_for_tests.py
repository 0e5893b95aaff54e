"""URDF files of other projects; tests are skipped if the files are missing."""

from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "shared" / "data" / "example_parallel_robots"


def example(name):
    """Return the path of the URDF file of an example, or skip the test."""
    path = EXAMPLES / name / "robot.urdf"
    if not path.is_file():
        pytest.skip(f"no {path}: example_parallel_robots is not here")
    return path
