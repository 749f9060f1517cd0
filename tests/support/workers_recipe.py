"""The dataset that processes and clusters make, each as the other."""

from small_dataset import SMALL

from twin.dataset.recipe import Recipe

RECIPE = Recipe(SMALL, ((-1.0, 1.0), (0.0, 2.0)), seconds=1.0, episodes=24, seeds=(5,))
