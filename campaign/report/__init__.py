"""Report of an archived run and its analyses: one HTML page, CSV tables and figures.

A report runs no trial and needs no network. Its content comes from the archive, the published
values and the templates. The same archive always results in the same bytes.
"""
