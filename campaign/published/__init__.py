"""Published values and their comparison with findings.

`thesis.toml` contains the tables of the thesis; `values` reads it, or a laboratory's own file of
the same form; `scoreboard` compares findings with cells.
"""
