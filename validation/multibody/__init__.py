"""The forced assembly in Exudyn: shares nothing with the model but the robot.

Begin at ``simulation.py``.
"""
