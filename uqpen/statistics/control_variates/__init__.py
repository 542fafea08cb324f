"""Control variates: statistics of a model from its runs, and from many more of its stand-ins.

A stand-in is a cheap model of the same outputs. At points that both have run, it explains most of
what the model does; at many further points its own statistics are all but known. The formulas hold
whatever a stand-in is worth: a poor one costs width, not truth.
"""
