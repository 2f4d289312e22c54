"""Recordings that other programs made, as tables: what a file holds before it means anything."""
