"""Stiffness K_C of the platform by direction, and contributions of the parts.

Start with ``platform_stiffness.py``; ``matrices.py`` defines its result.
"""
