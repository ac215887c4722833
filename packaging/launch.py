"""What both programs of the bundle begin with: `stripe-gui` or `stripe-core`, by the name of the file that was called.

One file under two names: half the room.
"""

import sys
from pathlib import Path

if sys.argv[1:2] == ["-c"]:  # as an interpreter: a reader that may come to grief has a process of its own
    code, sys.argv = sys.argv[2], ["-c", *sys.argv[3:]]
    exec(code)
    sys.exit()
if Path(sys.executable).name == "stripe-gui":
    from stripe_gui.__main__ import main
else:
    from core.cli import main

sys.exit(main())
