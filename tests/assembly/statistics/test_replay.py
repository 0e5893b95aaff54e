"""Stored results of a killed computation."""

import numpy as np
import pytest

from forcefit.assembly.statistics.replay import journalled
from forcefit.assembly.sweeps.sweep import journal_path


class Killed(Exception):
    """What ends a computation."""


def run(path, values, computed, stop=None, whose="mine"):
    """Squares and doubles of values, one after the other; those computed are listed."""

    def both(x):
        computed.append(x)
        return x * x, np.array([[x, 2.0 * x]])

    with journalled(path, {"whose": whose}) as replay:
        found = [replay.recall(lambda x=x: both(x), x, "square") for x in values]
        assert replay.asked == (0 if path is None else len(values))
        if stop:
            raise stop
    return found


@pytest.mark.parametrize("changed", [None, 1])
def test_stored_results_are_reused_only_for_equal_arguments(changed, tmp_path):
    path, values = tmp_path / "out.nc", [3.0, 4.0, 5.0]
    first, second = [], []
    with pytest.raises(Killed):
        run(path, values[:2], first, Killed())
    assert journal_path(path).exists()
    if changed is not None:
        values[changed] = 7.0
    found = run(path, values, second)
    assert first == [3.0, 4.0]
    assert second == ([5.0] if changed is None else [7.0, 5.0])
    for x, (square, both) in zip(values, found, strict=True):
        assert float(square) == x * x
        np.testing.assert_array_equal(both, [[x, 2 * x]])
    assert not journal_path(path).exists()


def test_results_are_computed_every_time_if_no_file_is_given():
    computed = []
    assert len(run(None, [1.0, 1.0], computed)) == 2
    assert computed == [1.0, 1.0]
