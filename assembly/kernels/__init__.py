"""Compiled C++ code, and the selection of the module for the processor.

Start with ``choice.py``.  ``kernels.h`` lists the functions and ``records.h`` their
arguments.
"""
