"""Speed over commits, for `asv`: see `docs/development/contributing.md`."""
