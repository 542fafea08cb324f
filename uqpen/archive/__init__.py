"""The archive: one NetCDF file with everything a study used and found.

Only this package writes NetCDF. A file appears under its name when it is whole, or not at all.
"""
