"""Work-precision measurements, and comparison with other programs."""
