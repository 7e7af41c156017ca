"""The files that `fuzz.py` feeds to mirrorfold, and how it damages them."""
