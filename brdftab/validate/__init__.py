"""Checks of every model of the registry: what must hold at ordinary and extreme settings, and the worst case of it."""
