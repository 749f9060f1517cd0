"""Evaluation: every method on the same records under the same noise, scored against the truth."""
