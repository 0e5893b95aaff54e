"""From measured deviations to the effect that a declared model lacks.

Begin at ``diagnose.py``: candidates, scores, verdict, errors before and after.
"""
