"""Archive: one NetCDF file with the input and the results of a study.

Only this package writes NetCDF. A file appears under its name when it is complete, or not at all.
"""
