"""A test kit that a laboratory runs against a backend of its own."""
