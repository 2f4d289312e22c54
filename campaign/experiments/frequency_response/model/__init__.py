"""What trials of a run make of a drive's frequency response."""
