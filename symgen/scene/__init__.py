"""Scene files: tables, units and expressions, and their resolved form."""
