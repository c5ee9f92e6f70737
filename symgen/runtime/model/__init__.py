"""Compiled models of linkages and user-defined systems."""
