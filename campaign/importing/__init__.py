"""Recordings of other programs: tables of files, and their mapping to channels and trials."""
