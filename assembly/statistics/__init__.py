"""What errors drawn at random do, and how loose tolerances may be.

Begin at ``monte_carlo.py``; ``allocation.py`` for tolerances.
"""
