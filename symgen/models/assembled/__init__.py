"""Assembled equations of linkages with elastic links in the plane, in letters."""
