"""Results of assemblies as text, JSON, tables and figures.

Start with ``results.py``.
"""
