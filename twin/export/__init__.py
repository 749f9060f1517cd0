"""Episodes for other programs: a dataset that LeRobot reads, CSV tables, or rewritten MCAP files."""
