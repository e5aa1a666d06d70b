"""Meshes: the surface that is handed on, reading and repair, remeshing, the half-edge structure."""
