"""Quantities of all results: one table, from which text, JSON and attributes are made.

Begin with :mod:`forcefit.results.quantities`.
"""
