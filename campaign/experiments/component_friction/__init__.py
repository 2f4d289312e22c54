"""Friction of components, measured one after another."""
