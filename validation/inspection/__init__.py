"""Find the effects that a campaign can and cannot show, before any diagnosis.

Start with ``inspection.py``.
"""
