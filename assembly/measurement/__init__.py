"""Predicted readings of a device that measures the pose of a robot.

Start with ``conditions.py``, the conditions of each measurement, then ``predict.py``.
"""
