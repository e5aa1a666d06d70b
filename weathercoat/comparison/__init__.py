"""Comparing runs: figures, geometry and pictures, against the noise between seeds."""
