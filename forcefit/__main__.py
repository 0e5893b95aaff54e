"""``python -m forcefit``: the same command."""

from forcefit.commands.app import main

main()
