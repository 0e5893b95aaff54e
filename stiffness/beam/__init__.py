"""Beam models of links: sections, compliances and stresses.

Start with ``beam.py``, which computes the compliance of a cantilever.
"""
