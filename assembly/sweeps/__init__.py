"""Sweeps: quantities of a robot at many postures, designs and draws, in one file.

Start with ``request.py`` for the options, ``sweep.py`` for the solution.
"""
