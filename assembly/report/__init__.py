"""Output of assembly results as text, JSON, tables and figures.

Start with ``results.py``.
"""
