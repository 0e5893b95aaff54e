"""Results of assemblies as text, JSON, tables and figures.

Begin at ``results.py``.
"""
