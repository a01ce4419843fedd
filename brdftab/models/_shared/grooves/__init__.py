"""Bounces between the two walls of a V-groove, seen in its cross-section."""
