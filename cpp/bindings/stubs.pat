# What the stub generator leaves out of dualdrive._core: values that differ from machine to machine.

dualdrive._core.__suffix__:
    __version__: str

dualdrive._core.__sundials_version__:
    __sundials_version__: str

dualdrive._core.__kernels__:
    __kernels__: str
