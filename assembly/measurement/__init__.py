"""Predicted readings of a measuring device on a robot with effects.

Start with ``conditions.py``, the conditions of each measurement, then ``predict.py``.
"""
