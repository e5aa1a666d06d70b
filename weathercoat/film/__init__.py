"""The paint film: its state, and how it separates, fractures and flakes."""
