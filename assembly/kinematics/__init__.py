"""Postures: solution of the nominal closures, and the maps of equations (13)-(15).

Start with ``posture.py``.
"""
