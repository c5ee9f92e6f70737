"""Running compiled kernels: numpy and the compiled core only; SymPy is never imported here."""
