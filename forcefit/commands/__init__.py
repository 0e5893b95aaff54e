"""The commands: each parses its options, calls one function, and prints or saves.

Start with ``app.py``.  ``options.py`` defines the options that several commands share.
"""
