"""Reports on K_E: text, comparison with a beam, export, and libraries.

Start with ``library.py`` for many links, or with ``compare.py`` for one link.
"""
