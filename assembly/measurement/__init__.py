"""Predicted readings of a measuring device on a robot with effects.

Begin at ``conditions.py``, the conditions of each measurement, and ``predict.py``.
"""
