"""Equilibrium with finite motions: the closures hold exactly, on SE(3).

Start with ``exact.py``.
"""
