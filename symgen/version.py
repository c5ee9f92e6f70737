"""The version of symgen, which checkpoints, results and cache keys carry."""

__version__ = "0.1.0"
