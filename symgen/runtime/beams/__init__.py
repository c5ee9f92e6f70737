"""Elastic links: element data, frames, reduction and internal forces."""
