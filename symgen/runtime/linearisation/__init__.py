"""Linear models about any state, and derivatives by parameters."""
