"""The serial protocol as bytes: frames and messages, without input or output."""
