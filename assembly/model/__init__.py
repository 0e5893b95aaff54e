"""Data of a robot: frames, joints with clearance, elastic links, geometric errors.

Start with ``robot.py``.
"""
