"""Command-line interface: each command parses its options and calls one function.

Start with ``app.py``.  ``options.py`` defines the options shared by several commands.
"""
