"""Import and export of robots from and to other programs: URDF, MJCF, SDF.

Start with ``robot_files.py`` and ``convert.py``; ``mechanism.py`` defines the
representation that all formats share.
"""
