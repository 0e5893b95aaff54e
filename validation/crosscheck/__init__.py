"""Compare model and simulation, quantity by quantity, at several scales.

Start with ``crosscheck.py``.  The compared quantities are defined in ``pose_metric.py``
and ``clearance_metric.py``.
"""
