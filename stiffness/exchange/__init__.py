"""Links of other finite-element programs, in and out: matrices of two interfaces.

Begin at ``import_link.py``; ``two_interfaces.py`` is what all of them mean.
"""
