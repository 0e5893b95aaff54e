"""Model and simulation compared number by number, over several scales.

Begin at ``crosscheck.py``; ``pose_metric.py`` and ``clearance_metric.py`` say what is
compared.
"""
