"""Generate synthetic measurements of a simulated machine with hidden effects.

Start with ``generator.py``.
"""
