"""Errors that each assumption of the model causes at a robot's pose.

Begin with ``assumptions.py``.
"""
