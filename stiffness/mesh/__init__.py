"""Tetrahedral meshes from a surface, refined where the solution is singular.

Start with ``mesh.py``.  ``lagrange.py`` numbers the nodes of curved elements.
"""
