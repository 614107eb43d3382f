"""`python -m auvnn` is `auvnn`."""

import sys

from auvnn.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
