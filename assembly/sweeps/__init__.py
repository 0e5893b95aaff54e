"""Sweeps: results for many postures, design parameters and random errors.

Start with ``request.py`` for the options and with ``sweep.py`` for the computation.
"""
