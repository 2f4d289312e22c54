"""Frequency responses of any recording, and what they say about a drive.

`welch` (spectra of any record: H1, H2, Hv, or by the reference of a loop), `multisine` (odd
random-phase multisines), `line_spectra`, `best_linear` and `distortion` (what repeated multisines
tell: best linear approximation, noise, even and odd distortion), `rational` and `orders` (a
rational function with a delay, and of which order), `modes`, `two_mass`.
"""
