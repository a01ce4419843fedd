"""Distributions of facets, their masking, and the frame of half vectors."""
