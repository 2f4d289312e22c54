"""The friction-velocity map, for each experiment that measures one: runs, points, fits, figures."""
