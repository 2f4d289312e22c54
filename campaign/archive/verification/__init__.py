"""Verification that a run is unchanged to the last byte, and the statement that is signed."""
