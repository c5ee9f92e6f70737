"""Models and analyses of linkages with elastic links."""
