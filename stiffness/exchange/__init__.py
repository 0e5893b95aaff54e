"""Import and export of links of other finite-element programs.

Begin at ``import_link.py``; ``two_interfaces.py`` defines the common matrix of two
interfaces.
"""
