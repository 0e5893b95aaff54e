"""Reading and writing of robot files, including links, joints and effects.

Start with ``robot_file.py``; ``docs/robot_files.md`` describes the format.
"""
