"""Compute accuracy and repeatability according to ISO standards.

Start with ``figures.py``.
"""
