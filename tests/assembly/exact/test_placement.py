"""Finite motions: the exponential of a screw and its two derivatives."""

import numpy as np
import pytest
from scipy.linalg import expm

from forcefit.assembly.kinematics.se3 import (
    bracket,
    exponential,
    inverse,
    left_jacobian,
    logarithm,
    second_form,
)


@pytest.mark.parametrize("size", [1e-7, 1e-2, 0.5, 1.5])
def test_finite_motion_equals_the_matrix_exponential_of_its_screw(rng, size):
    """Equal to SciPy's matrix exponential up to rounding."""
    s = size * rng.normal(size=6)
    generator = np.zeros((4, 4))
    x, y, z = s[:3]
    generator[:3] = [[0, -z, y, s[3]], [z, 0, -x, s[4]], [-y, x, 0, s[5]]]
    assert np.abs(exponential(s) - expm(generator)).max() < 1e-14
    if np.linalg.norm(s[:3]) < np.pi:
        assert np.abs(logarithm(exponential(s)) - s).max() < 1e-14 * max(1, 1 / size)
    assert np.abs(exponential(s) @ inverse(exponential(s)) - np.eye(4)).max() < 1e-14


@pytest.mark.parametrize("size", [1e-4, 0.1, 1.0])
def test_left_jacobian_equals_its_power_series(rng, size):
    """J = integral of Ad(exp(t s)), the series of ad^n / (n + 1)!."""
    s = size * rng.normal(size=6)
    J, term = np.eye(6), np.eye(6)
    for n in range(1, 40):
        term = term @ bracket(s) / (n + 1)
        J = J + term
    assert np.abs(left_jacobian(s) - J).max() < 1e-14


@pytest.mark.parametrize("size", [0.02, 0.3, 1.5, 3.0])
def test_second_form_equals_differences_of_the_exponential(rng, size):
    """By the product's expansion, for any turn; central differences leave 1e-8.

    log(exp(s + h) exp(-s)) = J h + D(h, h) / 2 + O(h^3): the even part is D.
    """
    s = size * np.ones(6) / np.sqrt(3)
    w, h = rng.normal(size=(2, 6))
    step = 2e-4

    def work(sign):
        return w @ logarithm(exponential(s + sign * step * h) @ inverse(exponential(s)))

    expected = (work(1) + work(-1)) / step**2
    rounding = 1e-16 / step**2
    form = second_form(s, w)
    assert np.abs(form - form.T).max() == 0.0
    scale = np.linalg.norm(w) * np.linalg.norm(h) ** 2
    assert abs(h @ form @ h - expected) < (10 * rounding + 1e-7) * scale


# Closures of a robot
