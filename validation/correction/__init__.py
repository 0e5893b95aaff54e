"""Apply a corrected robot: predict readings, correct commands, fit new sessions.

Start with ``prediction.py``; see ``docs/correction.md``.
"""
