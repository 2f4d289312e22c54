"""Reference values, pairs of them with what was found, and what a family of pairs comes to."""
