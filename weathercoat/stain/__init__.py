"""Stains: dust, runoff rust, substrate rust, and the colours they give."""
