"""``python -m roadeval``: the command, of the environment whose Python is named."""

import sys

from roadeval.cli.app import main

sys.exit(main())
