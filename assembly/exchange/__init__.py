"""Import and export of robots in the formats of other programs: URDF, MJCF and SDF.

Start with ``robot_files.py`` and ``convert.py``.  ``mechanism.py`` defines the common
representation of all formats.
"""
