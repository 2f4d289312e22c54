"""Outputs of friction models for prescribed motions."""
