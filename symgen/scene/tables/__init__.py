"""Functions given by tables of points, and profiles of motion."""
