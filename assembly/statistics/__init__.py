"""Monte Carlo statistics of geometric errors and tolerance allocation.

Start with ``monte_carlo.py`` for random errors, ``allocation.py`` for tolerances.
"""
