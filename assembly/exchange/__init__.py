"""Import and export of robots of other programs: URDF, MJCF, SDF.

Begin at ``robot_files.py`` and ``convert.py``; ``mechanism.py`` defines the
representation common to all formats.
"""
