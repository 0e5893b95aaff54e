"""Platform stiffness K_C, and contributions of links and joints to the compliance.

Start with ``platform_stiffness.py``; ``matrices.py`` defines its result.
"""
