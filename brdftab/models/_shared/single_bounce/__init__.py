"""Single reflection off facets: points, rows and tables, and its albedo."""
