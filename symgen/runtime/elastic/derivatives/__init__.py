"""Derivatives of elastic linkages by parameters: in a pose, along runs, of steady states."""
