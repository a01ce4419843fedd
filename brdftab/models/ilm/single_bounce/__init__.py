"""Light that meets the interface once from above: mirror reflection and the matte body below."""
