"""Results as text, JSON, tables and plots.

Begin at ``results.py``.
"""
