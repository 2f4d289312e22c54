"""Writing runs: trial by trial into a folder that no crash can spoil, then into one file."""
