"""Frequency responses of any recording, and the drive parameters that they determine.

`welch`: H1, H2, Hv, or with a loop's reference; `multisine`: odd random-phase multisines;
`line_spectra`, `best_linear`, `distortion`: best linear approximation, noise, even and odd
distortion from repeated multisines; `rational`, `orders`: rational function with a delay, and its
order; `modes`, `two_mass`: parameters.
"""
