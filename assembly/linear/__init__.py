"""The paper's equations (16)-(27), linear in small screws, at one posture or at many.

Begin at ``closure.py``, then ``energy.py`` (22), ``zone.py`` (21), ``pose_error.py``
(27).  Those three call the compiled methods in ``lanes.py``.  Problems that these do
not cover go to the numpy methods in the folder ``reference``.
"""
