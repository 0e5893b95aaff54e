"""The equilibrium with finite motions: closures hold on SE(3).

Begin at ``exact.py``.
"""
