"""Control loops with elastic links."""
