"""An independent check of finished runs; it shares no code with what writes them."""
