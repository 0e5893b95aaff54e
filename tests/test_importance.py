"""Sobol's indices against the literature and against the closed form."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.posture import place_robot
from assembly.robots import load_robot
from assembly.solvers.one_posture import prepare_energies
from assembly.statistics.distributions import tolerance_sources
from assembly.statistics.importance import (
    linear_importance,
    sobol_importance,
    source_groups,
)


def test_ishigamis_function_has_its_known_indices():
    """a = 7, b = 0.1 (Saltelli et al. 2008, p. 196): worked from its variance parts."""

    def ishigami(x):
        value = np.sin(x[:, 0]) * (1 + 0.1 * x[:, 2] ** 4) + 7 * np.sin(x[:, 1]) ** 2
        return np.stack([value, 3 * value + 1], axis=1)

    def sample(stream, count):
        rng = np.random.default_rng(stream)
        return rng.uniform(-np.pi, np.pi, size=(count, 3))

    groups = [(str(i), np.array([i])) for i in range(3)]
    found = sobol_importance(ishigami, sample, groups, 20_000)
    first, total = [0.3139, 0.4424, 0.0], [0.5576, 0.4424, 0.2437]
    for row in range(2):  # a scale and a shift change nothing
        np.testing.assert_allclose(found.first[row, :, 0], first, atol=0.03)
        np.testing.assert_allclose(found.total[row, :, 0], total, atol=0.03)
    inside = (found.total[..., 1] <= total) & (total <= found.total[..., 2])
    assert inside.mean() >= 0.5
    # variance 1/2 + a^2/8 + b pi^4/5 + b^2 pi^8/18 = 13.845
    assert found.variance[0] == pytest.approx(13.845, rel=0.03)


def test_without_play_the_closed_form_holds():
    """Then the platform's screw is linear in the errors."""
    robot = load_robot("irsbot2")
    robot = replace(
        robot, frames=tuple(replace(f, clearance=None) for f in robot.frames)
    )
    sources = tolerance_sources(robot, [1e-3] * 3 + [1e-4] * 3)
    one = prepare_energies(place_robot(robot))
    groups = source_groups(sources, "kind")
    columns = 6 * sources.frame + sources.component
    expected = linear_importance(one.screws[:, columns], sources, groups)
    np.testing.assert_allclose(expected.sum(axis=1), 1.0, rtol=1e-12)
    found = sobol_importance(
        lambda values: one.solve(sources.errors(values)).platform_screw,
        lambda stream, k: sources.draw(0, k, 1, stream), groups, 4000,
    )  # fmt: skip
    # 1 / sqrt(4000) is 0.016, and four of these
    np.testing.assert_allclose(found.first[..., 0], expected, atol=0.065)
    np.testing.assert_allclose(found.total[..., 0], expected, atol=0.065)
    slopes = one.screws[:, columns]
    spread = (slopes**2 * sources.variance).sum(axis=1)
    np.testing.assert_allclose(found.variance, spread, rtol=0.1)


def test_a_result_that_does_not_vary_has_no_indices():
    found = sobol_importance(
        lambda x: np.ones((len(x), 1)),
        lambda stream, k: np.random.default_rng(stream).random((k, 2)),
        [("a", np.array([0])), ("b", np.array([1]))], 100,
    )  # fmt: skip
    assert np.isnan(found.first).all()


def test_groups_by_kind_join_the_legs():
    robot = load_robot("irsbot2")
    sources = tolerance_sources(robot, [1e-3, 0, 0, 1e-4, 0, 0])
    names = [name for name, _ in source_groups(sources, "kind")]
    assert names == ["link_a.RX", "link_a.TX", "link_b.RX", "link_b.TX"]
    assert [len(c) for _, c in source_groups(sources, "frame")] == [2] * 4
    with pytest.raises(ValueError, match="by is 'leg'"):
        source_groups(sources, "leg")
