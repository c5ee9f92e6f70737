"""Compiled kernels: their description, their library, and calls of them."""
