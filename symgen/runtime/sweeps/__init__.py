"""Sweeps of parameters: designs, stores of results, execution in chunks."""
