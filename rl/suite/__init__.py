"""Comparisons that train what they are not given: the paper's, and the full benchmark."""
