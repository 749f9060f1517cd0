"""Parallel execution: worker processes of this machine, or a Dask cluster."""
