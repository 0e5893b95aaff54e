"""Reading and writing of robot files; links, joints and effects have their own modules.

Start with ``robot_file.py``; ``docs/robot_files.md`` describes the format.
"""
