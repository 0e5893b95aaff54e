"""Sweeps: quantities of a robot at many postures, designs and draws of errors.

Start with ``request.py`` for the options and ``sweep.py`` for the computation.
"""
