"""Whole model: friction models along any motion, fitted through the engine and compared."""
