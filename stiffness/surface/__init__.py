"""Surfaces of links: readers, checks, interfaces and exact shapes.

Start with ``surface.py``, which reads a surface, and ``interface.py``.
"""
