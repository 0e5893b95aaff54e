"""Synthetic measurement data of a simulated machine with hidden effects.

Start with ``generator.py``.
"""
