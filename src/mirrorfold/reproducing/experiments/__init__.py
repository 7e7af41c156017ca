"""The experiments, one file each; the function `run` of a file carries out its experiment."""
