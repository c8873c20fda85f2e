"""`python -m bootifol` is the `bootifol` command."""

from bootifol.cli.main import main

raise SystemExit(main())
