# What the stub generator leaves out of dualdrive._core.

dualdrive._core.__suffix__:
    __version__: str
