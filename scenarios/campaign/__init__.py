"""Many flights: a plan becomes jobs, processes fly them, a journal keeps what is done, a table is what comes of it."""
