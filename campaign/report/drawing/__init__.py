"""What a report draws: data in, SVG out, the same bytes for the same data."""
