"""Where numba keeps what it compiled: ``libraries.py``."""
