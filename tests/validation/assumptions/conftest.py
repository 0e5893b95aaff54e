"""Solids of links meshed as coarsely as a test can do with."""

import pytest

from stiffness.fem.fea import Budget, FemOptions
from validation.assumptions import solid_links


@pytest.fixture(scope="module")
def coarse_solids():
    """Bars good to one per cent."""
    with pytest.MonkeyPatch.context() as patch:
        solid_links._bar.cache_clear()
        options = FemOptions(0.01, budget=Budget(unknowns=60_000))
        patch.setattr(solid_links, "_OPTIONS", options)
        yield
        solid_links._bar.cache_clear()
