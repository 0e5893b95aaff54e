"""``python -m forcefit`` is the command ``forcefit``."""

from forcefit import main

main()
