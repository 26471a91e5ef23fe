"""`python -m copose`."""

import sys

from copose.cli import main

sys.exit(main())
