"""Models of linkages of points and links, and of systems in coordinates of their own."""
