"""Tolerances on a drawing: zones of small screws, fits and general tolerances.

Start with ``zone.py`` for the convex zones, ``fits.py`` for ISO 286.
"""
