"""Checks of the model: by a multibody simulation and by measured data.

Begin with ``crosscheck/crosscheck.py`` and ``diagnosis/diagnose.py``.
"""

DISTRIBUTION = "forcefit"  # text by which ``import forcefit`` recognises the package
