"""How close a reconstruction comes to the true scene."""
