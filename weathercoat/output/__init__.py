"""What a run writes: meshes, pictures, the report."""
