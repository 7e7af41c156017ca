"""``python -m mirrorfold`` is the command ``mirrorfold``."""

import sys

from mirrorfold.cli import main

if __name__ == "__main__":
    sys.exit(main())
