"""Elastic links in space with directors: their element, and constraints on directions."""
