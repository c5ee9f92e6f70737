"""Derivatives of loops by parameters: in a pose, of free loops, along runs."""
