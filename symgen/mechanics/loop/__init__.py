"""Derivations for single spatial loops by dual numbers (Rahman)."""
