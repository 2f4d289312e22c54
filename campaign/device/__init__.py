"""The rehearsal controller: a process that speaks the serial protocol, with a simulated bench."""
