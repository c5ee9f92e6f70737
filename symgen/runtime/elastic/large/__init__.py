"""Elastic links as beam elements in large rotation: their equations, assembled and stepped, and runs."""
