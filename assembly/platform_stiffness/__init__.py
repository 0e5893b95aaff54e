"""How stiff the platform is, in which direction, and which part gives way: K_C.

Begin at ``platform_stiffness.py``; ``matrices.py`` is what they return.
"""
