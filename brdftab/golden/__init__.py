"""Golden tables: small files of numbers that must not change unless someone means it."""
