"""Reading archives that nobody vouches for: what is damaged is named, the rest is there."""
