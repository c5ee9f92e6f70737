"""State-space models: equations of motion and outputs linearised about any state."""
