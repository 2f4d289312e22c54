"""Checks of recordings before an analysis, and processing of results after it."""
