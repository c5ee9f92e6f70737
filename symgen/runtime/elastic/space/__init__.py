"""Elastic links of linkages in space, in large rotation: assembly, model and runs."""
