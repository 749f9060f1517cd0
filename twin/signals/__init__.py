"""Signals over time: commands of the drive, noise of a sensor, the sensor itself."""
