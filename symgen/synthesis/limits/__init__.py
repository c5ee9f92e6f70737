"""Linkages of prescribed limit positions and transmission angles."""
