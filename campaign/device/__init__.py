"""The rehearsal controller: the other end of the serial line, with a simulated bench.

It replaces a servo controller in the rehearsal of a campaign: a separate process that implements
the serial protocol in real time and simulates faults on request.
"""
