"""Stiffness of a link: its 6 x 6 matrix K_E, from beams and from finite elements.

Begin with ``link.py``, which defines a link's stiffness; then ``beam/beam.py`` and
``fem/fea.py``, the two methods that compute it.
"""

# ``import forcefit`` searches this text to recognise the package as its own
DISTRIBUTION = "forcefit"
