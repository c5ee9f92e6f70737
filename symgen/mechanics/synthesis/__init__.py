"""Closure conditions of planar four-bars with prescribed properties."""
