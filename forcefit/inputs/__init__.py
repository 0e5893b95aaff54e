"""Input and output: files read and checked, files written whole or not at all.

Begin at ``table.py``, which reads TOML, and ``errors.py``, which words error messages.
"""
