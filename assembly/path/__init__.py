"""Errors of a robot along a path, including inertial effects.

The drives follow the path without control errors.  Start with
:func:`forcefit.assembly.path.path_errors.path_errors`.
"""
