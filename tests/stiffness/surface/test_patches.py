"""Tests of the patches of a surface."""

import numpy as np
import pytest
from scipy.integrate import quad

from forcefit.inputs.table import BadInput
from forcefit.stiffness.fem.elements import integration, isoparametric
from forcefit.stiffness.mesh.mesh import mesh_solid
from forcefit.stiffness.screws import rotation_matrix
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.patches import find_patches
from forcefit.stiffness.surface.primitives import (
    Cone,
    Plane,
    Sphere,
    Torus,
    fit_cone,
    fit_plane,
    fit_sphere,
    fit_torus,
)
from tests.solids_for_tests import bar
from tests.stiffness.surface.test_recognition import prism, revolved


def samples(shape, rng):
    """Return points on a part of each shape."""
    a, b = rng.uniform(0, 1.5, (2, 40))
    zero = 0 * a
    if isinstance(shape, Plane):
        return np.column_stack([a, b, zero])
    if isinstance(shape, Sphere):
        return 2 * np.column_stack([
            np.cos(a) * np.cos(b),
            np.sin(a) * np.cos(b),
            np.sin(b),
        ])
    if isinstance(shape, Torus):
        r, z = 2 + 0.5 * np.cos(b), 0.5 * np.sin(b)
    else:
        r, z = 2 + 0.3 * b, b
    return np.column_stack([r * np.cos(a), r * np.sin(a), z])


ORIGIN, Z = np.zeros(3), np.array([0.0, 0, 1])
SHAPES = [
    (fit_plane, Plane(ORIGIN, Z)),
    (fit_sphere, Sphere(ORIGIN, 2.0)),
    (fit_cone, Cone(ORIGIN, Z, 2.0, 0.3)),
    (fit_torus, Torus(ORIGIN, Z, 2.0, 0.5)),
]


@pytest.mark.parametrize(("fit", "shape"), SHAPES)
def test_fit_recovers_a_shape_from_points_on_it(fit, shape, rng):
    R, shift = rotation_matrix(rng.normal(size=3)), rng.normal(size=3)
    points = samples(shape, rng)
    normals = shape.signed(points)[1]
    fitted = fit(points @ R.T + shift, normals @ R.T)
    fresh = samples(shape, rng) @ R.T + shift
    assert np.abs(fitted.signed(fresh)[0]).max() < 1e-10


def test_slot_is_recognised_as_planes_and_half_cylinders():
    """There are no sharp edges between the tangent faces."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 17)
    half = 0.02 * np.column_stack([np.cos(angle), np.sin(angle)])
    outline = np.concatenate([half + [0.03, 0], -half - [0.03, 0]])
    surface = prism(outline, 0.05)
    patches = find_patches(surface, parse_interface("z=0"), parse_interface("z=0.05"))
    kinds = sorted(type(shape).__name__ for shape in patches.shapes[2:])
    assert kinds == ["Cone", "Cone", "Plane", "Plane"]


@pytest.mark.slow
def test_mesh_of_a_barrel_has_the_volume_of_the_smooth_shape(tmp_path):
    """The shape is not a cone, sphere or torus. The volume error is more than 0.6 % for
    flat facets and less than 0.03 % for the curved mesh.
    """

    def radius(share):
        return 0.02 + 0.006 * np.sin(np.pi * share)

    share = np.linspace(0, 1, 13)
    surface = revolved(radius(share), 0.1 * share, 32)
    exact = quad(lambda s: 0.1 * np.pi * radius(s) ** 2, 0, 1)[0]
    faces = parse_interface("z=0"), parse_interface("z=0.1")
    solid = mesh_solid(surface, *faces, edge=0.012, envelope=1e-3, cache=tmp_path)
    volume = sum(w.sum() for *_, w in integration(isoparametric(solid)))
    assert surface.volume / exact - 1 < -0.006
    assert abs(volume / exact - 1) < 3e-4


def test_same_interface_at_base_and_tip_is_rejected():
    with pytest.raises(BadInput, match="the same faces"):
        find_patches(bar(), parse_interface("z=0"), parse_interface("z=0"))
