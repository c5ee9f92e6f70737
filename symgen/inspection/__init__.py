"""Inspection of a scene: derived matrices in several formats, and the HTML page."""
