"""Run the command ``forcefit`` as ``python -m forcefit``."""

from forcefit.commands.app import main

if __name__ == "__main__":
    main()
