"""Import measuring-device files as campaigns.

Start with ``tracker.py``.
"""
