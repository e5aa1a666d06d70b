"""The simulation: one step in the paper's order, and what is recorded of it."""
