"""Where work is done side by side: processes of this machine, or a Dask cluster."""
