"""Benchmarks of the twin: physics against theory at full size, and speed (`endotwin benchmark`)."""
