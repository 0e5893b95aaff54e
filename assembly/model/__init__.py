"""What a robot is: frames, joints with clearance, elastic links, geometric errors.

Begin at ``robot.py``.
"""
