"""Where a robot stands: the nominal closures solved, equations (8) and (13)-(15).

Begin at ``posture.py``.
"""
