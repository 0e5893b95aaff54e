"""Stiffness and stress of a link by finite elements.

Start with ``fea.py``, which refines a mesh until the required accuracy is reached.
"""
