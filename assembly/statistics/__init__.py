"""Monte Carlo statistics of geometric errors, and allocation of tolerances.

Begin at ``monte_carlo.py`` for random errors, at ``allocation.py`` for tolerances.
"""
