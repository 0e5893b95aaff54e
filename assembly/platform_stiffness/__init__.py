"""Stiffness K_C of the platform, and contributions of the parts to its compliance.

Start with ``platform_stiffness.py``; ``matrices.py`` defines its result.
"""
