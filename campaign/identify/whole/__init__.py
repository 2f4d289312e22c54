"""Friction models of this program along archived motions, fitted through the engine."""
