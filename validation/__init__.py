"""Checks of the model: by a multibody simulation and by measured data.

Begin with ``crosscheck/crosscheck.py`` and ``diagnosis/diagnose.py``.
"""

# ``import forcefit`` searches this text to recognise the package as its own
DISTRIBUTION = "forcefit"
