"""Derivatives of loops: slopes at a state, tangents of steps."""
