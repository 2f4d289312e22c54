"""The report room: an archived run and its analyses become one HTML page, CSV tables and figures.

It runs no trial and reads no network: everything on the page comes from the archive, from the
published values and from the templates. The same archive always gives the same bytes.
"""
