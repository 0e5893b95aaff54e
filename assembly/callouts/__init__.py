"""Tolerances as a drawing states them: zones of small screws, fits, general tolerances.

Begin at ``zone.py`` for the convex zones, at ``fits.py`` for ISO 286.
"""
