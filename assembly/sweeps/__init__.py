"""One question at many postures, designs and draws, kept in one file.

Begin at ``request.py``, what is asked, and ``sweep.py``, how it is solved and resumed.
"""
