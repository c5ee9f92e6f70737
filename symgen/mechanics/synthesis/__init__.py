"""Conditions that planar four-bars of asked properties meet."""
