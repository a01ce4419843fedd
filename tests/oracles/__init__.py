"""Independent answers that the tests compare the library with; nothing here imports a kernel of the library."""
