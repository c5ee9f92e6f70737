"""Synthesis of planar four-bars: from prescribed properties to all linkages that have them."""
