"""Labels for training: pictures with what each pixel shows, and one JSON that describes them."""
