"""Reading and writing of robot files, with a module each for links, joints and effects.

Start with ``robot_file.py``; ``docs/robot_files.md`` describes the format.
"""
