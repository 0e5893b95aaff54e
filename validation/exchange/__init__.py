"""Import of measuring devices' files as campaigns.

Begin at ``tracker.py``.
"""
