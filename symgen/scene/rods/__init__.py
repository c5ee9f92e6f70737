"""Scenes with points and links: tables, and the linkage they resolve to."""
