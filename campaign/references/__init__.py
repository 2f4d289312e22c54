"""Reference values, their pairs with findings, and the verdicts of a family of pairs."""
