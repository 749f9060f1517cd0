"""MCAP's bytes: records, chunks, and the container that holds them."""
