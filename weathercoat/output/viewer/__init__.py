"""The viewer of a run: one HTML page that holds the meshes, their scalars and the figures, and needs no
network.
"""
