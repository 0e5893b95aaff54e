"""From tetrahedra to K_E: elements, condensation, error estimate, stress.

Begin at ``fea.py``, which refines until the estimated error is small enough.
"""
