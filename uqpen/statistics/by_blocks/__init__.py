"""Statistics of more runs than memory holds, from accumulators that take block after block.

An accumulator is made from some runs, adds chunks of runs in their order, and is then read. Every
pass over the runs is the same loop (`passes.py`). The distribution of an output is counted between
splitters, so any of its order statistics is found exactly by collecting the few intervals that hold
those asked for. A `BlockedSample` answers the analyses of a `Sample` from that.
"""
