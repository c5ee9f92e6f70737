"""Momentum rows of a linkage: the published form of its equations of motion."""
