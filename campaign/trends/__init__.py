"""A rig's numbers over its runs: do they drift, have they jumped, do they follow anything?"""
