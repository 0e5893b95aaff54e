"""Solids of links meshed as coarsely as a test can do with."""

import pytest

from stiffness.fem.fea import Budget, FemOptions
from validation.assumptions import solid_links


@pytest.fixture(scope="module")
def coarse_solids():
    """Bars good to two per cent."""
    with pytest.MonkeyPatch.context() as patch:
        solid_links._bar.cache_clear()
        patch.setattr(
            solid_links, "_OPTIONS", FemOptions(0.02, budget=Budget(levels=1))
        )
        yield
        solid_links._bar.cache_clear()
