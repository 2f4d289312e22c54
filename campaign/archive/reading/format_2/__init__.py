"""Reading archives of formats 1 and 2, which nobody writes any more.

Every dataset has a checksum of its own there, and nothing binds one to another.
"""
