"""Host end of the line to a controller: port, heartbeats, session."""
