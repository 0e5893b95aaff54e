"""Results on K_E: text, comparison with a beam, export, and libraries.

Begin at ``library.py`` for many links, at ``compare.py`` for one.
"""
