"""Sweeps: the same quantities at many postures, designs and draws, in one file.

Begin at ``request.py`` for the options, and at ``sweep.py`` for the solution.
"""
