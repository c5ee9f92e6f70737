"""Derivations, each stating its source and equation numbers."""
