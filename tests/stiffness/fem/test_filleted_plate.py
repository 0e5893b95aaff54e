"""Test of a filleted plate from a CAD program."""

import numpy as np
import pytest

from forcefit.stiffness.fem.fea import FemOptions, solve_link
from forcefit.stiffness.fem.material import Material
from tests.stiffness.surface.test_recognition import ENDS, filleted_plate, volume_of

# upper bounds on the diagonal of K, computed by another program
BOUNDS = [45822, 48702, 9.5734e6, 1.04078e9, 2.89622e8, 2.92001e6]


@pytest.mark.slow
def test_stiffness_of_a_filleted_plate_is_below_upper_bounds(tmp_path):
    """The volume agrees with the exact volume to 0.01 %, and no element is flat."""
    options = FemOptions(0.1, cache=tmp_path)
    materials = [Material(7e10, 0.3)]
    solved = solve_link(filleted_plate(), *ENDS, materials, options=options)
    mesh, K = solved.link.mesh, np.diag(solved.link.stiffness)
    assert mesh["volume"] == pytest.approx(volume_of(), rel=1e-4)
    assert mesh["worst_quality"] > 0.01
    assert (K / BOUNDS - 1).max() < 0.003
    assert (K / BOUNDS - 1).min() > -0.08
    assert mesh["reached"]
    off = abs(mesh["volume"] / volume_of() - 1)
    assert off < solved.link.relative_error_estimate
