"""Postures: the nominal closures solved, and the maps of equations (13)-(15).

Begin at ``posture.py``.
"""
