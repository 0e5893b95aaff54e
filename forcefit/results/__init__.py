"""Quantities of all results: a table that defines names, units and descriptions.

Start with :mod:`forcefit.results.quantities`.
"""
