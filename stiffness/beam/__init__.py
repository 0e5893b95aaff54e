"""Closed forms for links: sections, straight and curved beams, and their stress.

Begin at ``beam.py``, the compliance of a cantilever.
"""
