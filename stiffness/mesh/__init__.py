"""Tetrahedral meshes of links.

Start with ``mesh.py``, which meshes the surface of a link.
"""
