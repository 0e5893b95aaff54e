"""Cone programmes and polytopes over plain arrays; they know no robot.

Begin at ``conic.py``, the second-order cone programme, and ``interior.py``, its
compiled interior-point method; ``cones.h`` and ``dual_newton.h`` of
:mod:`assembly.kernels` do the same for several problems side by side.
"""
