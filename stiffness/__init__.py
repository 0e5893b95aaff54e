"""How stiff is a link?  Its 6 x 6 stiffness K_E, from beams and from finite elements.

Begin at ``link.py``, what a link's stiffness is; then ``beam/beam.py`` and
``fem/fea.py``, the two ways to it.
"""

DISTRIBUTION = "forcefit"  # which `import forcefit` looks for
