"""Scenes: many objects with their places, each weathered by its exposure."""
