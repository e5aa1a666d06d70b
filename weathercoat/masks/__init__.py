"""Masks of steering: from the config, files and a surface to plain arrays."""
