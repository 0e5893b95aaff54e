"""A part's surface: read, checked, divided at its two interfaces.

Begin at ``surface.py``; ``interface.py`` defines where a part is held and moved.
"""
