"""Tetrahedra from a surface; they are refined where the solution is singular.

Begin at ``mesh.py``; ``lagrange.py`` numbers the unknowns of curved elements.
"""
