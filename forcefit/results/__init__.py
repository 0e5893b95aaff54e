"""Quantities of all results: one table for text, JSON and attributes.

Begin with :mod:`forcefit.results.quantities`.
"""
