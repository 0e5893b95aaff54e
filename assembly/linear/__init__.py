"""Equations (16)-(27) of the paper, at one or many postures.

Start with ``closure.py``.  Continue with ``energy.py`` for problem (22), ``zone.py``
for problem (21) and ``pose_error.py`` for problem (27).  These three modules call the
compiled methods in ``lanes.py`` and use the numpy methods in ``reference`` for problems
that the compiled methods do not cover.
"""
