"""Predict readings, correct commands and fit new sessions with a saved robot.

Start with ``prediction.py``; see ``docs/correction.md``.
"""
