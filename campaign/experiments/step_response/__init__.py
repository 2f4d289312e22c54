"""Step responses of the loop."""
