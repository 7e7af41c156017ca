"""The experiments, one file each; `run` does it."""
