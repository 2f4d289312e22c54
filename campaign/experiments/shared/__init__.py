"""What several experiments use. None of these modules is an experiment."""
