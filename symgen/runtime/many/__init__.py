"""Many runs of one model in a call."""
