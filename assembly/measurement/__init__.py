"""Predict the readings of a device that measures the pose of a robot.

Start with ``conditions.py``, which describes each measurement, then ``predict.py``.
"""
