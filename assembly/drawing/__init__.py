"""Robots as they are drawn: bodies and joints by points and axes of the home pose.

Begin at ``drawing.py``, the data; ``frames.py`` makes the robot of frames and closures,
``drawing_of_robot.py`` the drawing of any robot.
Files of drawings are read in ``assembly/files/drawing_file.py``.
"""
