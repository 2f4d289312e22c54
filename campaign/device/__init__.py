"""The rehearsal controller: a process that speaks the serial protocol and simulates the bench behind it."""
