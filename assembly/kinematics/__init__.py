"""Postures of a robot with closed loops, and maps of small screws, eqs (13)-(15).

Start with ``posture.py``.
"""
