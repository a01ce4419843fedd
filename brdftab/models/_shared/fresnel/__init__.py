"""What a smooth interface reflects and transmits, and its projection from wavelengths to channels."""
