"""Robots as drawn: bodies and joints, given by points and axes in the home pose.

Start with ``drawing.py``, which defines the data.  ``frames.py`` converts a drawing to
a robot of frames and closures; ``drawing_of_robot.py`` converts a robot to a drawing.
Drawing files are read in ``assembly/files/drawing_file.py``.
"""
