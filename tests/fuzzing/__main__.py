"""``python -m tests.fuzzing``: see there."""

import sys

from tests.fuzzing.trials import main

sys.exit(main())
