"""The same problems compiled, for many postures or many draws of the errors.

Begin at ``many_postures.py`` and ``zone_margins.py``; ``many_draws.py`` and
``many_margins.py`` keep the posture and take many draws of the errors.
"""
