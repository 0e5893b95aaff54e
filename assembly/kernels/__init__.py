"""Compiled C++ code, and the choice of its module.

Begin with ``choice.py``; ``kernels.h`` lists the functions, ``records.h`` their
arguments.
"""
