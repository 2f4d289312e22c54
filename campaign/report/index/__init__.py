"""One page over a results folder: what was run, what came of it, and where its report is."""
