"""Quantities of all results: one table for texts, JSON and attributes.

Begin with :mod:`forcefit.results.quantities`.
"""
