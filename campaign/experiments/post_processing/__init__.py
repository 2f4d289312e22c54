"""What becomes of recordings before an analysis sees them, and of what several draws found."""
