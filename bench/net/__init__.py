"""The net: stored answers of 60 diagnoses, by which a change of the house shows that it changed no answer."""
