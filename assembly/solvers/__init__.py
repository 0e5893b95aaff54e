"""Solvers for second-order cone programs.

Start with ``conic.py``, which returns certified solutions.  ``one_problem.py`` calls
the compiled methods of ``assembly/kernels/solvers``.
"""
