"""What recordings say for and against a structure, in nats: the one place that forms a marginal likelihood."""
