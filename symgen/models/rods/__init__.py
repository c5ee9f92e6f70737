"""From a linkage of points and links to its System."""
