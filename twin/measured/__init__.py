"""Logs from outside: CSV files of real endoscopes, read into episodes and recorded commands."""
