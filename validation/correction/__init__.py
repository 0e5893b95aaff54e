"""Use of a corrected robot: predicted readings, corrected commands, new sessions.

Begin at ``prediction.py``; see ``docs/correction.md``.
"""
