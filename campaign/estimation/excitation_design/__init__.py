"""Excitation signals for identification: pure, seeded functions on arrays."""
