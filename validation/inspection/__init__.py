"""Determine which effects a campaign can reveal, before any diagnosis.

Start with ``inspection.py``.
"""
