"""Moments of inertia of frames and of combined bodies."""

import numpy as np
import pytest

from forcefit.assembly.model.inertia import joined_bodies
from forcefit.assembly.model.robot import Frame
from forcefit.inputs.table import BadInput
from forcefit.stiffness.screws import rotation_matrix


def box(mass, edges):
    """Return the moments of inertia of a box about its centre."""
    a, b, c = np.square(edges)
    return mass / 12 * np.diag([b + c, a + c, a + b])


@pytest.mark.parametrize("turn", [[0, 0, 0], [0.3, -1.1, 0.7]])
def test_moments_of_three_joined_boxes_equal_those_of_one_box(turn):
    R, at = rotation_matrix(turn), np.array([0.3, -0.2, 0.5])
    cuts = np.array([0.0, 0.1, 0.25, 0.6])
    lengths = np.diff(cuts)
    middles = (cuts[1:] + cuts[:-1]) / 2 - 0.3
    mass, centre, J = joined_bodies([
        (10 * x, at + R @ [middle, 0, 0], R @ box(10 * x, [x, 0.2, 0.05]) @ R.T)
        for x, middle in zip(lengths, middles, strict=True)
    ])
    assert mass == pytest.approx(6.0, rel=1e-15)
    np.testing.assert_allclose(centre, at, rtol=1e-14)
    np.testing.assert_allclose(J, R @ box(6, [0.6, 0.2, 0.05]) @ R.T, atol=1e-15)


def test_moments_of_a_massless_body_do_not_change():
    mass, centre, J = joined_bodies([(0.0, np.ones(3), np.eye(3))])
    assert mass == 0.0
    np.testing.assert_array_equal(centre, np.zeros(3))
    np.testing.assert_array_equal(J, np.eye(3))


@pytest.mark.parametrize(("inertia", "message"), [
    ([[1, 0.1, 0], [0, 1, 0], [0, 0, 1]], "not symmetric"),
    (np.diag([1.0, 1.0, -0.1]), "principal moments -0.1, 1, 1"),
    (np.diag([0.1, 1.0, 1.2]), "principal moments 0.1, 1, 1.2"),
])  # fmt: skip
def test_impossible_moments_of_inertia_are_rejected(inertia, message):
    with pytest.raises(BadInput, match=r'^frame "arm"\.inertia: found .*' + message):
        Frame("arm", mass=1.0, inertia=inertia)


def test_moments_of_a_thin_plate_are_accepted():
    """A plate with Iz = Ix + Iy and a thin rod are valid in any axes."""
    R = rotation_matrix([0.4, 0.5, -0.6])
    for moments in ([1.0, 2.0, 3.0], [0.0, 1.0, 1.0]):
        J = R @ np.diag(moments) @ R.T
        np.testing.assert_allclose(Frame("arm", inertia=J).inertia, J, atol=1e-15)
