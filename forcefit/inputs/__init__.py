"""Reading and validation of input files, and atomic writing of output files.

Start with ``table.py``, which reads TOML, and ``errors.py``, which composes error
messages.
"""
