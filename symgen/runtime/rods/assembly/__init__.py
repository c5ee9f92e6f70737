"""Assembly modes of linkages in closed form: groups of one point, and larger ones with one on a circle."""
