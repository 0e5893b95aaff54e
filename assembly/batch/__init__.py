"""The same problems compiled, for many postures or many draws of the errors.

Begin at ``many_postures.py``; ``many_draws.py`` keeps the posture and draws the errors.
"""
