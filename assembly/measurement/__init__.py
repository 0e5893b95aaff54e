"""What an instrument would read of a robot with effects, row by row.

Begin at ``conditions.py``, what a row is measured under, and ``predict.py``.
"""
