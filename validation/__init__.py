"""Compare the model with a multibody simulation and with measured data.

Start with ``crosscheck/crosscheck.py`` for simulations, or with
``diagnosis/diagnose.py`` for measured data.
"""

if __name__ == "validation":  # imported by its former name from a checkout
    from forcefit.old_packages import use_present_name

    use_present_name(__name__)
