"""Modes of links and of their structure at rest, and damping by their ratios."""
