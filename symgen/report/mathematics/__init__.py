"""Equations, derivation records and their changes as text and LaTeX."""
