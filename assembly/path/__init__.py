"""Errors of a robot that moves along a path, inertial effects included.

The drives follow the path exactly.  Start with
:func:`forcefit.assembly.path.path_errors.path_errors`.
"""
