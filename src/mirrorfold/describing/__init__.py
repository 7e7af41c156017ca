"""What a file holds and resolves, and what a measurement will show before it is made."""
