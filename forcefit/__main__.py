"""``python -m forcefit`` is the command ``forcefit``."""

from forcefit.commands.app import main

if __name__ == "__main__":
    main()
