"""Executing a plan: order, progress, stopping, safe state. Displays subscribe to progress."""
