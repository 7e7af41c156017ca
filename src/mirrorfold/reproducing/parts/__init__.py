"""What several experiments measure and draw, and the longer pages of single ones."""
