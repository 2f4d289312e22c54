"""One CiA 402 drive on a CAN bus: its objects, its states, and the process that owns the bus."""
