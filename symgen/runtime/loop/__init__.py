"""Closed loops of links: models, following and motion."""
