"""Equilibrium with finite motions, whose closures hold on SE(3).

Start with ``exact.py``.
"""
