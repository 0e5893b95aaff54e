"""The paper's equations (16)-(27), linear in small screws, at one posture.

Begin at ``closure.py``, then ``energy.py`` (22), ``zone.py`` (21), ``pose_error.py``
(27).
"""
