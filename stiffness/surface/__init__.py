"""Surface of a part: reading, checking, and division at its two interfaces.

Start with ``surface.py``.  ``interface.py`` defines the faces that are held and moved.
"""
