"""Example programs that use sweeps."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[3] / "examples"
pytestmark = pytest.mark.slow


def run(name, *words):
    """Return the standard output of an example."""
    done = subprocess.run(
        [sys.executable, EXAMPLES / name, *map(str, words)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_example_of_figure_5_runs_for_both_sign_conventions(tmp_path):
    """The coarse grid is a subset of the reference grid, so its energies are within the
    same range.
    """
    said = run("paper_figure5.py", "--step", "0.2", "-o", tmp_path)
    assert said.count("assemble by clearances with compliant joints free") == 2
    for signs in ("literal", "signed"):
        assert (tmp_path / f"figure5_{signs}.png").read_bytes().startswith(b"\x89PNG")
    least, _, most = re.findall(r"energy \[J\] +(\S+) / (\S+) / (\S+)", said)[0]
    assert 1.1e-3 <= float(least) < float(most) <= 14.7


def test_example_hexapod_with_less_clearance_has_smaller_errors(tmp_path):
    said = run("hexapod_accuracy.py", "--draws", 2, "--step", 0.1, "-o",
               tmp_path / "hexapod.nc")  # fmt: skip
    play, error = (
        [float(n) for n in re.findall(p, said)]
        for p in (
            r"with (\S+) um of clearance",
            r"translation 90 % below .* (\S+) um at the worst",
        )
    )
    alone = [float(n) for n in re.findall(r"by clearances alone (\S+) um", said)]
    assert sorted(play) == [4.0, 8.0]
    large, small = play.index(8.0), play.index(4.0)
    assert error[small] < error[large]
    assert alone[small] < alone[large]
    # The cardan joints keep their clearance, so the error decreases by a smaller factor
    # than the clearance of the ball joints.
    assert alone[small] > 0.5 * alone[large]
