"""Metadata of an HDF5 file, read without the HDF5 library.

The library acts on what a file says: it opens other files, and some data types end the process. So
what uqpen does not write is looked for before the library gets the file. The names of structures
and messages are those of the "HDF5 File Format Specification Version 3.0".
"""
