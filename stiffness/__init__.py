"""Stiffness of a link: its 6 x 6 matrix K_E, from beams and from finite elements.

Start with ``link.py``, which defines a link's stiffness.  The two methods that compute
it are in ``beam/beam.py`` and ``fem/fea.py``.
"""

if __name__ == "stiffness":  # package name of the last release, used in a checkout
    from forcefit.old_packages import use_present_name

    use_present_name(__name__)
