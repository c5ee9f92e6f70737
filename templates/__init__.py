"""Templates of everything symgen generates: layout only; every expression reaches them as finished text."""
