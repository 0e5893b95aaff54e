"""Errors of the platform's pose and stiffness that each assumption of the model causes.

Start with ``assumptions.py``.
"""
