"""Closed-form link models: sections, straight and curved beams, and their stress.

Start with ``beam.py``, which computes the compliance of a cantilever.
"""
