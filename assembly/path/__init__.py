"""Errors of a robot that moves along a path, by its own inertia; drives held on it.

Begin with :func:`forcefit.assembly.path.path_errors.path_errors`.
"""
