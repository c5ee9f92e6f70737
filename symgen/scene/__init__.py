"""What the user writes: the scene file, its units and expressions, and what they resolve to."""
