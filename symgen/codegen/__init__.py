"""Source text from a Program; identical input gives byte-identical output."""
