"""Postures of a robot: nominal loop closure, and maps of small screws, eqs (13)-(15).

Start with ``posture.py``.
"""
