"""Robots as they are drawn: bodies and joints by points and axes of the home pose.

Begin at ``drawing.py``, the data; ``frames.py`` makes the robot of frames and closures.
Files of drawings are read in ``assembly/files/drawing_file.py``.
"""
