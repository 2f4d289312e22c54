"""Page over a results folder: runs, their results, and links to their reports."""
