"""NetCDF files, whoever has written them: they are looked through before a library gets them.

The HDF5 and NetCDF libraries act on what a file says of itself. They open other files, and some
contents end the process. `opening` is the one module that calls them.
"""
