"""Small motions below breakaway."""
