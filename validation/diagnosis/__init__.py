"""From measured deviations to the effect that a declared model lacks.

Begin at ``diagnose.py``: selection of effects, learning, ``judge.py`` the verdict;
``diagnosis.py`` is what comes of it.
"""
