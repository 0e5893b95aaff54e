"""Import and export of links between forcefit and finite-element programs.

Begin at ``import_link.py``; ``two_interfaces.py`` defines the matrix of a body between
two interfaces.
"""
