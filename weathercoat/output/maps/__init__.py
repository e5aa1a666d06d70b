"""Maps on the texture coordinates of the input: the aged surface as pictures that the input itself wears."""
