"""Estimators of the bending angle: arrays in, arrays out, batched over noise seeds."""
