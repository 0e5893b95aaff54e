"""One posture, prepared once for many draws of the errors: (22) and (21).

Begin at ``many_draws.py`` and ``many_margins.py``.
"""
