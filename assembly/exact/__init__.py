"""Equilibrium with finite motions and exact loop closure on SE(3).

Start with ``exact.py``.
"""
