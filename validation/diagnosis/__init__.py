"""From measured deviations to the effect that a declared model lacks.

Begin at ``diagnose.py``: selection of effects, learning of functions, and the verdict
of ``judge.py``; ``diagnosis.py`` holds the result.
"""
