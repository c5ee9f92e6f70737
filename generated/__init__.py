"""Generated kernels of the shipped models. Do not edit: run ``symgen generate``."""
