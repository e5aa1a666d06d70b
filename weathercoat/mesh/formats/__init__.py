"""One module a format: bytes in, `Polygons` out, every index and count checked against what the file holds."""
