"""Datasets: from a recipe to a folder of episodes that is described, verified and made again."""
