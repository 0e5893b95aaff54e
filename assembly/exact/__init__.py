"""Equilibrium with finite motions; loop closure is imposed exactly, on SE(3).

Start with ``exact.py``.
"""
