"""The scenes that come with symgen, one TOML file a mechanism."""
