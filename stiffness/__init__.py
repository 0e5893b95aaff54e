"""Stiffness of a link: its 6 x 6 matrix K_E, from beams and from finite elements.

Begin with ``link.py``, which defines a link's stiffness; then ``beam/beam.py`` and
``fem/fea.py``, the two methods that compute it.
"""

if __name__ == "stiffness":  # the name of the last release, in a checkout
    from forcefit.old_packages import use_present_name

    use_present_name(__name__)
