"""Simulate the forced assembly in Exudyn; only the robot's data are shared.

Start with ``simulation.py``.
"""
