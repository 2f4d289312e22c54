"""The rehearsal controller: the other end of the serial line, with a simulated bench behind it.

It stands in for a servo controller while a campaign is rehearsed: a process of its own that speaks
the serial protocol, keeps step with the clock, and fails on demand.
"""
