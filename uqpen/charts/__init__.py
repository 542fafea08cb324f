"""Charts as data: what is drawn, in which colours and with which words.

A chart has axes, marks, a legend and notes. It is painted twice: for the page by `report.plotly`,
and for papers by `figures.painter`. So a chart is written once.
"""
