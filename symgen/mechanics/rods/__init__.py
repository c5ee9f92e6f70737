"""Derivations for linkages in point coordinates (Attia)."""
