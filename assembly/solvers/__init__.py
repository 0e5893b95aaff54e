"""Cone programmes over plain arrays; they know no robot.

Begin at ``conic.py``, the second-order cone programme with its proof;
``one_problem.py`` calls the compiled methods of ``assembly/kernels/solvers``.
"""
