"""Parts that several experiments share; none of these modules is an experiment."""
