"""Assembly modes, mobility and redundancy of closed loops."""
