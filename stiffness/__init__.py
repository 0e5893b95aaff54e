"""Link stiffness: the 6 x 6 matrix K_E, from beam theory or finite elements.

Start with ``link.py``, which defines the stiffness of a link. It is computed by either
``beam/beam.py`` or ``fem/fea.py``.
"""

if __name__ == "stiffness":  # package name in the last release, for use in a checkout
    from forcefit.old_packages import use_present_name

    use_present_name(__name__)
