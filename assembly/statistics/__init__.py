"""Monte Carlo statistics of geometric errors and tolerance allocation.

Start with ``monte_carlo.py`` for random errors and with ``allocation.py`` for
tolerances.
"""
