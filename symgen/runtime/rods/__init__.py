"""Analyses of linkages of points and links."""
