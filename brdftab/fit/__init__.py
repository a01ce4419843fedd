"""Fitting models to measured and tabulated data."""
