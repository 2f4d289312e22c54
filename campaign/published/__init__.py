"""Published values, and which findings speak to which of them.

`thesis.toml` holds the thesis' tables; `values` reads it, or a laboratory's own file of the same
form; `scoreboard` holds findings against cells.
"""
