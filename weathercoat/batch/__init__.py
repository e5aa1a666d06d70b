"""Many assets: jobs, what they cost, the executors that run them, and the record of a batch."""
