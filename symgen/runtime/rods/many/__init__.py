"""Many variants of a linkage in compiled code, in SIMD lanes where they fit."""
