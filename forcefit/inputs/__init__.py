"""The ground floor: input read and refused, output written whole or not at all.

Begin at ``table.py``, which reads TOML, and ``errors.py``, the words of a refusal.
"""
