"""Reading and checking of input files, and writing of output files as a whole.

Begin with ``table.py``, which reads TOML, and ``errors.py``, which words the errors.
"""
