"""The full suite of `endotwin evaluate`: its records, fits, methods, limit, tables and figures."""
