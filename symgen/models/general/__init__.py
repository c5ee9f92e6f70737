"""User-defined systems that move."""
