"""Monte Carlo statistics of geometric errors, and tolerance allocation.

Begin at ``monte_carlo.py``; ``allocation.py`` for tolerances.
"""
