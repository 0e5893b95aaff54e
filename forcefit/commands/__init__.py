"""Every command: parse, call one function, print or save.

Begin at ``app.py``; ``options.py`` has the options that commands share.
"""
