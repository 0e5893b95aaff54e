"""Checks of the model: by a multibody simulation and by measured data.

Begin with ``crosscheck/crosscheck.py`` and ``diagnosis/diagnose.py``.
"""

if __name__ == "validation":  # the name of the last release, in a checkout
    from forcefit.old_packages import use_present_name

    use_present_name(__name__)
