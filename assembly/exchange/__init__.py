"""Robots of other programs, in and out: URDF, MJCF, SDF.

Begin at ``robot_files.py`` and ``convert.py``; ``mechanism.py`` is what all formats
have in common.
"""
