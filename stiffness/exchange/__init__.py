"""Import and export of links between forcefit and finite-element programs.

Start with ``import_link.py``.  ``two_interfaces.py`` defines the matrix of a body with
two interfaces.
"""
