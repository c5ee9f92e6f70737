"""Straight-line programs from a System: folding, sharing, factorisation, operation counts."""
