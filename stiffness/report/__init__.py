"""Reports, figures, exports and libraries of link stiffnesses.

Start with ``compare.py`` for a single link, or with ``library.py`` for many links.
"""
