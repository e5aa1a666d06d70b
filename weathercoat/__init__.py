"""Age painted metal: remesh a model and simulate how its paint separates, cracks, curls, flakes off and rusts."""

__version__ = "0.1.0"
