"""Values of any model: at points, in bulk, as albedos and as importance samples."""
