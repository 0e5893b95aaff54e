"""Effects that a campaign can and cannot show, before any diagnosis.

Begin with ``inspection.py``.
"""
