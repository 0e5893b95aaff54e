"""What an isotropic material is, and which is none."""

import numpy as np
import pytest

from forcefit.inputs.errors import BadInput
from stiffness.fem.material import Material


def test_without_a_density_a_material_has_no_mass():
    assert Material(2.1e11, 0.3).density == 0.0


@pytest.mark.parametrize("density", [-1e-9, np.inf, np.nan])
def test_a_density_that_is_none_is_refused(density):
    with pytest.raises(BadInput, match="density"):
        Material(2.1e11, 0.3, density)
