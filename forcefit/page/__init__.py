"""Reports: one self-contained HTML page, in the same form for every kind of result.

Start with :func:`forcefit.page.page.page`.  A page consists of pieces of HTML: tables
(:mod:`forcefit.page.tables`), charts and maps (:mod:`forcefit.page.charts`), and
scenes.  The page stores numbers in SI units and shows them in display units
(:mod:`forcefit.results.units`).  The script ``page.js`` draws charts, sorts tables,
changes units and shows the values of a point that the reader clicks.
"""
