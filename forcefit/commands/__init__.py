"""The commands: each parses its options, calls one function, and prints or saves.

Begin at ``app.py``; ``options.py`` has the options that several commands share.
"""
