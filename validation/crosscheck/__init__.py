"""Compare model and multibody simulation at several scales of the imperfections.

Start with ``crosscheck.py``.  The compared quantities are defined in ``pose_metric.py``
and ``clearance_metric.py``.
"""
