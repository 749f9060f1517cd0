"""Closed-loop control of the bending angle: controllers, the plant, trials, tuning and scores."""
