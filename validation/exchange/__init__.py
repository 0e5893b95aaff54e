"""Import files of measuring devices as campaigns.

Start with ``tracker.py``.
"""
