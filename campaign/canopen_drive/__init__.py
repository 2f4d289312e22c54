"""One CiA 402 drive on a CAN bus: objects, states, and the process that owns the bus."""
