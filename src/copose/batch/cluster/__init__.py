"""Studies on a Dask cluster: local worker processes or a scheduler that exists, and its workers."""
