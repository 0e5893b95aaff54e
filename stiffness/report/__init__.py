"""K_E shown, compared with a beam's, exported and kept in a library.

Begin at ``library.py`` for many links, at ``compare.py`` for one.
"""
