"""One module a format: bytes in, `Polygons` out, every index and count checked against the file."""
