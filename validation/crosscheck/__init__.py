"""Comparison of model and simulation, quantity by quantity, at several scales.

Begin at ``crosscheck.py``; ``pose_metric.py`` and ``clearance_metric.py`` define the
compared quantities.
"""
