"""Structures of elastic links in space that rotate at a constant speed: assembly and modes."""
