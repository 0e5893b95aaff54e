"""All compiled code, C++, and which module of it is used.

Begin at ``choice.py``; ``kernels.h`` lists the functions, ``records.h`` what they take.
"""
