"""Closed forms: sections, straight and curved beams, their stress.

Begin at ``beam.py``: the compliance of a cantilever.
"""
