"""Import of links from finite-element programs, and export to them.

Start with ``import_link.py``.  ``two_interfaces.py`` defines the matrix of a body with
two interfaces.
"""
