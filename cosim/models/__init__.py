"""FMUs and SSPs made from the cards and models that a scenario names."""
