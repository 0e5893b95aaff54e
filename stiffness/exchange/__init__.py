"""Import and export of links for finite element programs.

Start with ``import_link.py`` and ``export_link.py``.
"""
