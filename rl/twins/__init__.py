"""RAM whose active model predicts by reduced twins: what it is trained on, its step, and how it learns."""
