"""Solvers of cone programmes on plain arrays, independent of robots.

Start with ``conic.py``, the second-order cone programme with its certificate.
``one_problem.py`` calls the compiled methods of ``assembly/kernels/solvers``.
"""
