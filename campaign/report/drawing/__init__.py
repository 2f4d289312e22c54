"""Drawings of a report: SVG from data, with the same bytes for the same data."""
