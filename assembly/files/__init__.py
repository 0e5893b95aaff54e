"""Robot files, read and written: links, joints and effects each have a file.

Begin at ``robot_file.py``; the format is ``docs/robot_files.md``.
"""
