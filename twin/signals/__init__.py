"""Signals over time: command signals, measurement noise, and the bending sensor."""
