"""Estimate the errors in pose and stiffness caused by each modelling assumption.

Start with ``assumptions.py``.
"""
