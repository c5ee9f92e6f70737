"""Time integration: options, step loop, checkpoints and failures."""
