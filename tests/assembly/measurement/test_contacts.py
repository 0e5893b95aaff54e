"""Equilibrium of contact springs in series with joints."""

import numpy as np
import pytest

from forcefit.assembly.measurement.conditions import ContactLaw
from forcefit.assembly.measurement.contacts import contact_deflections

LAWS = (ContactLaw("a", 3e5, 1.5), ContactLaw("b", 2e3, 1.1))


def in_unit(force):
    """Return the contact laws with forces in another unit."""
    return tuple(ContactLaw(x.frame, x.coefficient * force, x.exponent) for x in LAWS)


def law(one, d):
    return one.coefficient * np.abs(d) ** one.exponent * np.sign(d)


@pytest.mark.parametrize("force", [1e-9, 1.0])
def test_coupled_contacts_are_in_equilibrium(rng, force):
    """Newton's method converges in a few steps."""
    B = rng.normal(size=(6, 2, 2)) * 300
    A = -force * B @ B.mT
    w = force * rng.normal(size=(6, 2)) * [50.0, 20.0]
    d, converged = contact_deflections(in_unit(force), w, A)
    assert converged.all()
    loads = np.stack([law(one, d[:, i]) for i, one in enumerate(in_unit(force))], 1)
    left = loads - w - np.einsum("rij,rj->ri", A, d)
    assert np.abs(left).max() < 1e-9 * np.abs(w).max()
