"""Comparisons that train missing methods: the paper's, and the full one."""
