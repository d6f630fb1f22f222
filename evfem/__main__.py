"""`python -m evfem` is the command `evfem`."""

import sys

from evfem.cli import main

if __name__ == "__main__":
    sys.exit(main())
