"""Scenes with a link-joint table: rows, bodies, and the loop they resolve to."""
