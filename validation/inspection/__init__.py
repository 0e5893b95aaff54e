"""What measured data can and cannot tell, before any diagnosis.

Begin at ``inspection.py``.
"""
