"""Elastic links of a scene: sections, elements, and the crank that drives them."""
