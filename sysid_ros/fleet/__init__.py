"""Many recordings of many robots over months: jobs on Dask, and the store that keeps what they found."""
