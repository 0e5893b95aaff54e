"""K_E by finite elements: tetrahedra, condensation, error estimate and stress.

Start with ``fea.py``, which refines the mesh until the estimated error is small enough.
"""
