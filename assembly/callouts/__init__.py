"""Tolerances on engineering drawings: tolerance zones, fits and general tolerances.

Start with ``zone.py`` for convex tolerance zones and with ``fits.py`` for ISO 286 fits.
"""
