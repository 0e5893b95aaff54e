"""The forced assembly in Exudyn, independent of the model except for the robot.

Begin at ``simulation.py``.
"""
