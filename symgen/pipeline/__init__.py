"""From a scene or a user-defined system to a compiled model."""
