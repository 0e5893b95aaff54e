"""Robots of other programs, in and out: URDF, MJCF, SDF.

Begin at ``convert.py``; ``mechanism.py`` is what all formats have in common.
"""
