"""Light that meets the walls of a V-cavity more than once."""
