"""SymPy tools without mechanics: quantities, systems of equations, differentiation."""
