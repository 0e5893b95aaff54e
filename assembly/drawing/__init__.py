"""Drawings: robots given by bodies and joints, with points and axes in the home pose.

Start with ``drawing.py``, which defines the data model.  ``frames.py`` converts a
drawing to a robot with frames and closures, and ``drawing_of_robot.py`` converts a
robot to a drawing.  Drawing files are read in ``assembly/files/drawing_file.py``.
"""
