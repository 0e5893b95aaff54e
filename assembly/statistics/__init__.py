"""Monte Carlo statistics of geometric errors, and tolerance allocation.

Begin at ``monte_carlo.py`` for draws, at ``allocation.py`` for tolerances.
"""
