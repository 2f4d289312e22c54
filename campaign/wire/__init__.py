"""The serial protocol as bytes: frames and messages, without any input or output."""
