"""Predict readings, correct commands, and fit a saved robot to new sessions.

Start with ``prediction.py``; see ``docs/correction.md``.
"""
