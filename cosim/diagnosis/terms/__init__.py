"""What has no name is modelled too: a term learned from what was recorded, where the answer says "unknown"."""
