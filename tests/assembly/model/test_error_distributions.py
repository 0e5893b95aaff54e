"""Random draws of geometric errors: reproducibility and distributions."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from forcefit.assembly.model.error_distributions import read_sources, tolerance_sources
from forcefit.assembly.robots import load_robot
from forcefit.inputs.table import BadInput

FILE = """
[[errors]]
frames = ["crank_pin"]
most = [1e-3, 0, 0, 1e-4, 0, 0]
[[errors]]
frames = ["middle"]
least = [5e-4, 0, 0, 0, 0, 0]
most = [1e-3, 0, 0, 1e-4, 0, 0]
signs = "literal"
[[errors]]
frames = ["point"]
distribution = "normal"
centre = [0, 0, 0, 0, 0, 2e-5]
deviation = [0, 1e-3, 0, 0, 0, 1e-5]
[[errors]]
frames = ["end_rocker"]
distribution = "truncated"
deviation = [0, 1e-3, 0, 0, 0, 0]
most = [0, 1.5e-3, 0, 0, 0, 0]
"""


@pytest.fixture
def sources(write_file):
    return read_sources(write_file(FILE), load_robot("four_bar"))


def test_draws_do_not_depend_on_the_block_size(sources):
    whole = sources.draw(0, 1000, seed=7)
    cut = [sources.draw(a, b - a, seed=7) for a, b in ((0, 1), (1, 400), (400, 1000))]
    np.testing.assert_array_equal(np.vstack(cut), whole)


def test_different_seeds_and_streams_have_different_random_numbers(sources):
    draws = [sources.draw(0, 200, *key) for key in ((1, 0), (2, 0), (1, 1))]
    for a, b in ((0, 1), (0, 2), (1, 2)):
        assert not np.any(draws[a] == draws[b])


def test_draws_have_the_requested_distribution(sources):
    """Kolmogorov-Smirnov test of 1e5 draws against the distributions of SciPy."""
    x = sources.draw(0, 100_000, seed=3).T
    laws = {
        "crank_pin.RX": stats.uniform(-1e-3, 2e-3),
        "crank_pin.TX": stats.uniform(-1e-4, 2e-4),
        "middle.RX": stats.uniform(5e-4, 5e-4),
        "middle.TX": stats.uniform(0, 1e-4),
        "point.RY": stats.norm(0, 1e-3),
        "point.TZ": stats.norm(2e-5, 1e-5),
        "end_rocker.RY": stats.truncnorm(-1.5, 1.5, scale=1e-3),
    }
    assert sources.labels == tuple(laws)
    for label, values, mean, variance in zip(
        sources.labels, x, sources.mean, sources.variance, strict=True
    ):
        law = laws[label]
        assert stats.kstest(values, law.cdf).pvalue > 1e-3, label
        assert mean == pytest.approx(law.mean(), abs=1e-12 * law.std()), label
        assert variance == pytest.approx(law.var(), rel=1e-9), label


def test_errors_with_random_signs_have_a_minimum_magnitude():
    robot = load_robot("four_bar")
    sources = tolerance_sources(robot, [1e-3, 0, 0, 0, 0, 0])
    gapped = replace(sources, least=np.full(len(sources), 0.4))
    s = gapped.standard(gapped.uniforms(0, 50_000, 1))
    assert np.abs(s).min() >= 0.4
    assert np.abs(s).max() <= 1.0
    assert abs((s > 0).mean() - 0.5) < 5 / np.sqrt(s.size)
    # The mean of s^2 over [0.4, 1] is (1 + 0.4 + 0.16)/3 = 0.52.
    np.testing.assert_allclose(gapped.variance, 0.52 * 1e-6, rtol=1e-12)
    assert np.mean(s**2) == pytest.approx(0.52, abs=0.003)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("most = [1e-3, 0", "moist = [1e-3, 0"), "most: missing"),
        (('"middle"', '"midle"'), 'no frame "midle"'),
        (('"normal"', '"gauss"'), 'distribution: found "gauss"'),
        (("least = [5e-4", "least = [5e-3"), "least: expected 0 <= least <= most"),
        (('"literal"', '"positive"'), 'signs: found "positive"'),
        (('"middle"', '"crank_pin"'), 'found "crank_pin.RX" a second time'),
        (("most = [0, 1.5e-3", "most = [0, 0"), "most: expected a bound > 0"),
        (("most = [1e-3, 0", "most = [1e300, 0"), "most: found"),
        (("deviation = [0, 1e-3, 0, 0, 0, 1e-5]", "deviation = [0, -1, 0, 0, 0, 0]"),
         "deviation: expected numbers >= 0"),
    ],
)  # fmt: skip
def test_invalid_tolerance_file_is_rejected(change, message, write_file):
    path = write_file(FILE.replace(*change, 1))
    with pytest.raises(BadInput) as error:
        read_sources(path, load_robot("four_bar"))
    assert message in str(error.value)
    assert str(path) in str(error.value)
