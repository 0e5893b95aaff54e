"""K_E from tetrahedra: elements, condensation, error estimate, stress.

Begin at ``fea.py``, which refines until the estimated error is small enough.
"""
