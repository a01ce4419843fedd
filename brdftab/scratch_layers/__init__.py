"""Scratches as users handle them: one traced scratch, layers of many, their maps and pictures."""
