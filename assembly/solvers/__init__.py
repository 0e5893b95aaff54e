"""Cone programmes over plain arrays, independent of robots.

Begin at ``conic.py``, the second-order cone programme with its proof;
``one_problem.py`` calls the compiled methods of ``assembly/kernels/solvers``.
"""
