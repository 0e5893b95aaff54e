"""Effects that a campaign can show and cannot show, before any diagnosis.

Begin with ``inspection.py``.
"""
