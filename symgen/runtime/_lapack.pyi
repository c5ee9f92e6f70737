"""Routines of LAPACK; see ``_lapack.pyx``."""
