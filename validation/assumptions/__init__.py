"""Compute the errors in pose and stiffness that each modelling assumption causes.

Start with ``assumptions.py``.
"""
