"""Properties of friction models: Table 3.1, from virtual experiments."""
