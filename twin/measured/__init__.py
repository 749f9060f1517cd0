"""Measured logs: CSV files of real endoscopes, read into episodes and recorded commands."""
