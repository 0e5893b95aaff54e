"""Reading and checking of input files, and complete writing of output files.

Start with ``table.py``, which reads TOML, and ``errors.py``, which composes error
messages.
"""
