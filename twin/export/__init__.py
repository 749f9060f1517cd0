"""Episodes for other programs: a dataset that LeRobot reads, CSV tables, or MCAP files written anew."""
