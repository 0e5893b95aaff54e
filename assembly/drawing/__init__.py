"""Robots described by bodies and joints, with points and axes in the home pose.

Start with ``drawing.py``, which defines the data model.  ``frames.py`` converts bodies
and joints to frames and closures, and ``drawing_of_robot.py`` is the inverse
conversion.  Robot files of format 2 are read in ``assembly/files/drawing_file.py``.
"""
