"""Synthesis of planar four-bars: from asked properties to all linkages that have them."""
