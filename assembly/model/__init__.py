"""Data of a robot: frames, joints with clearance, elastic links, geometric errors.

Begin at ``robot.py``.
"""
