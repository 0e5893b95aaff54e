"""A part's surface: read, checked, cut at its two interfaces.

Begin at ``surface.py``; ``interface.py`` says where a part is held and moved.
"""
