"""C++ of the packages: compiled where a compiler stands, loaded once.

Begin at ``libraries.py``.
"""
