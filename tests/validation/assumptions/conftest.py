"""Fixtures with coarse meshes of solid links, for quick tests."""

import pytest

from forcefit.stiffness.fem.fea import Budget, FemOptions
from forcefit.validation.assumptions import solid_links


@pytest.fixture(scope="module")
def coarse_solids():
    """Solve bars to an accuracy of one per cent."""
    with pytest.MonkeyPatch.context() as patch:
        solid_links._bar.cache_clear()
        options = FemOptions(0.01, budget=Budget(unknowns=60_000))
        patch.setattr(solid_links, "_OPTIONS", options)
        yield
        solid_links._bar.cache_clear()
