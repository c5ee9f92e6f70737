"""From a System to straight-line programs: fold, share, factorise, count. Its results hold no SymPy."""
