"""Model and simulation compared number by number, over several scales.

Begin at ``crosscheck.py``; ``playcheck.py`` keeps the clearances.
"""
