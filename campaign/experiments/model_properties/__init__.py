"""Which properties of friction a model has: Table 3.1, from virtual experiments."""
