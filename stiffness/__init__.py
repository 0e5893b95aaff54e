"""Computation of the 6 x 6 stiffness matrix of a link.

Start with ``link.py``, which defines the stiffness of a link. ``beam/beam.py`` computes
the stiffness from beam theory, and ``fem/fea.py`` from finite elements.
"""

if __name__ == "stiffness":  # package name in the last release
    from forcefit.old_packages import use_present_name

    use_present_name(__name__)
