"""What a test comes to, in sentences made from its estimates; a file for each family."""
