"""Steady states of elastic linkages: shooting over a revolution, Floquet multipliers."""
