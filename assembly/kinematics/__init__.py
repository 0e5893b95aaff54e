"""Postures: solution of the nominal closures, and maps of small screws, eqs (13)-(15).

Start with ``posture.py``.
"""
