"""Many variants of a loop in SIMD lanes."""
