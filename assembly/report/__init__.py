"""Answers as text, JSON, tables and pictures.

Begin at ``results.py``.
"""
