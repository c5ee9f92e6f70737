"""Derivations for elastic links by Hamilton's principle."""
