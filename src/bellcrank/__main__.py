"""`python -m bellcrank` is the command `bellcrank`."""

from bellcrank.cli import main

raise SystemExit(main())
