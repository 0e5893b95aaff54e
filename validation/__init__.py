"""Is it true?  Against a multibody simulation, and against measured data.

Begin at ``crosscheck/crosscheck.py`` and at ``diagnosis/diagnose.py``.
"""

DISTRIBUTION = "forcefit"  # which `import forcefit` looks for
