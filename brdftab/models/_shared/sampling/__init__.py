"""Importance sampling of facets."""
