"""Monte Carlo statistics of geometric errors, and allocation of tolerances.

Start with ``monte_carlo.py`` for random errors, ``allocation.py`` for tolerances.
"""
