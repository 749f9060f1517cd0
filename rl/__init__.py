"""Everything learned: environments, PPO, training of networks, export; nothing is imported at once."""
