"""Comparison of model and simulation, number by number, at several scales.

Begin at ``crosscheck.py``; ``pose_metric.py`` and ``clearance_metric.py`` define the
quantities compared.
"""
