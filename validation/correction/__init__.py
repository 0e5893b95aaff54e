"""Use of a corrected robot: predicted readings, corrected commands, new sessions.

Begin at ``prediction.py``; the docs are ``docs/correction.md``.
"""
