"""Estimators: what recordings say about friction, with their uncertainty."""
