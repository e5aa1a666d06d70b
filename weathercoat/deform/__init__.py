"""Position-based deformation: length, angle and substrate constraints, and the sweeps over them."""
