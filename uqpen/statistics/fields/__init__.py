"""Statistics of fields: at each place, along all places at once, and of whole curves.

A place is one entry of a field along its dimensions. A statistic of a field has the dimensions of
the field before its own.
"""
