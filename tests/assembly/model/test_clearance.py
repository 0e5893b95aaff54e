"""Sizes of clearances against their bounds."""

import warnings

import numpy as np

from assembly.model.clearance import clearance_excess


def test_a_bound_next_to_nothing_is_exceeded_without_a_warning():
    """Size over bound is then no double."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        screws = np.array([[1.0, 0, 0, 0, 0, 0]])
        excess = clearance_excess(screws, np.array([[5e-324, np.inf, 0.0, 0.0]]))
    assert excess == np.inf
