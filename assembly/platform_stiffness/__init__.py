"""Stiffness K_C of the platform by direction, and the shares of the parts in it.

Begin at ``platform_stiffness.py``; ``matrices.py`` holds its result.
"""
