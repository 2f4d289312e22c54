"""Writing runs: trial by trial into a crash-safe folder, then into one file."""
