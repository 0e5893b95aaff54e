"""Springs of a law in series: Newton's method against bisection, in any unit."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

from assembly.kinematics.posture import home_posture
from assembly.linear.energy import solve_assembly
from assembly.measurement.conditions import ContactLaw
from assembly.measurement.contacts import contact_deflections, secants
from assembly.measurement.row_state import Rows
from assembly.model.robot import Frame, Robot

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
def test_each_contact_by_itself_is_where_bisection_finds_it(rng, force):
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
def test_contacts_that_load_each_other_balance(rng, force):
    """What A carries over, in a few steps of Newton's method."""
    B = rng.normal(size=(6, 2, 2)) * 300
    A = -force * B @ B.mT
    w = force * rng.normal(size=(6, 2)) * [50.0, 20.0]
    d, converged = contact_deflections(in_unit(force), w, A)
    assert converged.all()
    loads = np.stack([law(one, d[:, i]) for i, one in enumerate(in_unit(force))], 1)
    left = loads - w - np.einsum("rij,rj->ri", A, d)
    assert np.abs(left).max() < 1e-9 * np.abs(w).max()


def test_a_secant_is_deflection_over_load_and_none_without_load():
    """(F / c)^(1 / n) / F along the slider's own z."""
    K = np.diag([np.inf] * 5 + [1e4])
    robot = Robot("slide", "b", (
        Frame("a", joint="prismatic", joint_stiffness=K), Frame("b", "a"),
    ))  # fmt: skip
    one = ContactLaw("a", 3e5, 1.5)
    for F in (20.0, -1e-3):
        assembly = solve_assembly(home_posture(robot), [0, 0, 0, 0, 0, F])
        expected = (abs(F) / 3e5) ** (1 / 1.5) / abs(F)
        assert secants(assembly, (one,)) == pytest.approx([expected], rel=1e-9)
    assert secants(solve_assembly(home_posture(robot)), (one,)).tolist() == [0.0]


def rows_with(d):
    """Rows that know nothing but their contacts' deflections in the linear model."""
    return Rows(SimpleNamespace(laws=LAWS), None, None, np.asarray(d, dtype=float))


def test_the_tangent_of_a_contact_is_its_laws():
    """By differences; and it touches the law."""
    d = np.array([[1e-4, -2e-3], [-3e-5, 1e-2]])
    rows = rows_with(d)
    w = np.stack([law(one, d[:, i]) for i, one in enumerate(LAWS)], axis=1)
    assert rows.deflection(w) == pytest.approx(d, rel=1e-12)
    assert rows.tangent_deflection(w) == pytest.approx(d, rel=1e-12)
    h = 1e-5 * np.abs(w)
    slope = (rows.deflection(w + h) - rows.deflection(w - h)) / (2 * h)
    assert rows.contact_compliance == pytest.approx(slope, rel=1e-8)
    change = rows.tangent_deflection(w + h) - d
    assert change == pytest.approx(slope * h, rel=1e-6)


def test_a_contact_of_a_nanometre_is_a_linear_spring():
    """With the secant at 1e-9: the same load per deflection, and no load, none."""
    small = rows_with([[1e-10, -5e-11], [0.0, 1e-12]])
    least = np.array([one.coefficient * 1e-9**one.exponent for one in LAWS])
    secant = np.array([1e-9, 1e-9]) / least
    assert small.contact_compliance == pytest.approx(np.array([secant] * 2), rel=1e-12)
    for share in (0.0, 0.3, -0.7):
        w = np.array([share * least] * 2)
        expected = np.array([[share * 1e-9] * 2] * 2)
        assert small.deflection(w) == pytest.approx(expected, rel=1e-12, abs=1e-24)
        assert small.tangent_deflection(w) == pytest.approx(
            expected, rel=1e-9, abs=1e-24
        )
