"""Measured data of a simulated machine with hidden effects.

Begin at ``generator.py``.
"""
