"""The C++ core of dualdrive."""



__sundials_version__: str = '6.4.1'

__version__: str
