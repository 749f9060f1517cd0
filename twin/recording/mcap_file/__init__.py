"""MCAP file format: records, chunks, and the container."""
