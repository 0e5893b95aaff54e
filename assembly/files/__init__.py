"""Robot files, read and written; links, joints and effects have a module each.

Begin at ``robot_file.py``; the format is ``docs/robot_files.md``.
"""
