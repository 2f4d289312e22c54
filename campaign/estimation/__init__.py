"""Estimators of friction and motion: pure functions on arrays, with uncertainties."""
