"""What each assumption of the model costs a robot at a pose.

Begin at ``assumptions.py``.
"""
