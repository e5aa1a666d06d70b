"""The config: typed, bounded, described parameters, and how they are loaded from YAML."""
