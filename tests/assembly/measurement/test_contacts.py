"""Contact laws in series with springs: Newton's method against bisection."""

import numpy as np
import pytest
from scipy.optimize import brentq

from forcefit.assembly.measurement.conditions import ContactLaw
from forcefit.assembly.measurement.contacts import contact_deflections

LAWS = (ContactLaw("a", 3e5, 1.5), ContactLaw("b", 2e3, 1.1))


def in_unit(force):
    """The laws with forces in another unit."""
    return tuple(ContactLaw(x.frame, x.coefficient * force, x.exponent) for x in LAWS)


def law(one, d):
    return one.coefficient * np.abs(d) ** one.exponent * np.sign(d)


def alone(one, stiff, load):
    """Where a contact and a linear spring carry a load together, by bisection."""
    return brentq(lambda x: law(one, x) + stiff * x - load, -1.0, 1.0, xtol=1e-16)


@pytest.mark.parametrize("force", [1e-12, 1e-6, 1.0, 1e9])
def test_deflection_of_a_single_contact_equals_bisection(rng, force):
    """c |d|^n sign d = w - k d; loads of either sign, and none."""
    w = np.array([[40.0, -3.0], [-1e-3, 2e2], [0.0, 5.0], [0.0, 0.0]])
    k = np.array([1e5, 4e3])
    A = np.broadcast_to(-force * np.diag(k), (4, 2, 2))
    d, converged = contact_deflections(in_unit(force), force * w, A)
    assert converged.all()
    for row, loads in zip(d, w, strict=True):
        for found, load, one, stiff in zip(row, loads, LAWS, k, strict=True):
            left = alone(one, stiff, load)
            assert found == pytest.approx(left, rel=1e-8, abs=1e-14)


@pytest.mark.parametrize("force", [1e-9, 1.0])
def test_coupled_contacts_are_in_balance(rng, force):
    """The matrix A couples them; Newton's method converges in a few steps."""
    B = rng.normal(size=(6, 2, 2)) * 300
    A = -force * B @ B.mT
    w = force * rng.normal(size=(6, 2)) * [50.0, 20.0]
    d, converged = contact_deflections(in_unit(force), w, A)
    assert converged.all()
    loads = np.stack([law(one, d[:, i]) for i, one in enumerate(in_unit(force))], 1)
    left = loads - w - np.einsum("rij,rj->ri", A, d)
    assert np.abs(left).max() < 1e-9 * np.abs(w).max()
