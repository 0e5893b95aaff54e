"""One question at many postures, draws and designs."""
