"""What `fuzz.py` feeds to mirrorfold, and how it damages it."""
