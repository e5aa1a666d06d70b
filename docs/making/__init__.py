"""What `docs/make.py` is made of: generated pages, pictures of parameters, and the gallery."""
