"""Names, units and descriptions of all result quantities.

Start with :mod:`forcefit.results.quantities`.
"""
