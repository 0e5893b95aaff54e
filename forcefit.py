"""The command ``forcefit``: mounts the three folders' commands, plus ``study``."""
