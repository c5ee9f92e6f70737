"""From a Program to source text, the same to the byte for the same input."""
