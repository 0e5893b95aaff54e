"""Solvers of cone programs on plain arrays, independent of robots.

Start with ``conic.py``, the second-order cone program with its certificate.
``one_problem.py`` calls the compiled methods of ``assembly/kernels/solvers``.
"""
