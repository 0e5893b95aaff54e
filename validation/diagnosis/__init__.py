"""From measured deviations to the effect that a declared model lacks.

Begin at ``diagnose.py``, which selects effects and learns functions.  ``judge.py``
finds the verdict; ``diagnosis.py`` holds the result.
"""
