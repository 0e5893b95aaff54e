"""Reports: one self-contained HTML page, in the same form for every kind of result.

Begin with :func:`forcefit.page.page.page`.  A page consists of pieces of HTML: tables
(:mod:`forcefit.page.tables`), charts and maps (:mod:`forcefit.page.charts`), and
scenes.  Numbers are in SI in the data of the page, and in display units on the screen
(:mod:`forcefit.results.units`).  The script ``page.js`` draws charts, sorts tables,
changes units and shows the numbers of a point.
"""
