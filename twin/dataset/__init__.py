"""Datasets: from a recipe to a folder of episodes that can be described, verified and reproduced."""
