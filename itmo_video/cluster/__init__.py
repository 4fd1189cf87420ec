"""Conversion on a Dask cluster."""
