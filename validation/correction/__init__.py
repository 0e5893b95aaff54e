"""A corrected robot at work: readings foretold, commands corrected, sessions carried.

Begin at ``prediction.py``; the docs are ``docs/correction.md``.
"""
