"""Errors of a robot that moves along a path, including its inertia.

The drives follow the path exactly.  Start with
:func:`forcefit.assembly.path.path_errors.path_errors`.
"""
