"""The Dask cluster: providers, workers, resources, and calls that survive the death of a worker."""
