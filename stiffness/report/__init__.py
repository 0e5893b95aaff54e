"""Results on K_E: text, comparison with a beam, export, libraries.

Begin at ``library.py`` for many links, at ``compare.py`` for one.
"""
