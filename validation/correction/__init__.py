"""A corrected robot at work: readings predicted, commands corrected, sessions carried.

Begin at ``prediction.py``; the docs are ``docs/correction.md``.
"""
