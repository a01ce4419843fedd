"""The commands: one thin module each; everything heavy is imported inside."""
