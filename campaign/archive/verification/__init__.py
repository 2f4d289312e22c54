"""Whether a run is, to the last byte, what was written, and what a signature of it covers."""
