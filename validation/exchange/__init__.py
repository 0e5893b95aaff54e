"""Measuring devices' own files, made into campaigns.

Begin at ``tracker.py``.
"""
