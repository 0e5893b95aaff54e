"""Surface of a part: reading, checks, and division at its two interfaces.

Begin at ``surface.py``; ``interface.py`` defines the faces that are held and moved.
"""
