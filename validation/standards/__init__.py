"""Compute accuracy and repeatability according to ISO standards from repeats.

Start with ``figures.py``.
"""
