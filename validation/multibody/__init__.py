"""Simulation of the forced assembly in Exudyn; it shares only the robot's data.

Begin at ``simulation.py``.
"""
