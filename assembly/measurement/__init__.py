"""Predicted readings of a measuring device on a robot with effects.

Begin at ``conditions.py`` for the conditions of each measurement, then ``predict.py``.
"""
