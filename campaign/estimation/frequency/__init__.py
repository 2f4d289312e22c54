"""Frequency responses of any recording, and the drive parameters that they determine.

`welch` (spectra of any record: H1, H2, Hv, or by the reference of a loop), `multisine` (odd
random-phase multisines), `line_spectra`, `best_linear` and `distortion` (from repeated multisines:
best linear approximation, noise, even and odd distortion), `rational` and `orders` (a rational
function with a delay, and its order), `modes`, `two_mass`.
"""
