"""Cone programmes and polytopes over plain arrays; they know no robot.

Begin at ``conic.py``, the second-order cone programme, and ``interior.py``, its
compiled interior-point method; ``cpp/cones.h`` and ``cpp/dual_newton.h`` do the same
for several problems side by side, compiled by ``forcefit/native``.
"""
