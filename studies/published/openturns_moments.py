"""The function of the example "Estimate moments from sample" of OpenTURNS."""


def outputs(x1, x2):
    """Return both outputs for standard normal inputs."""
    return {"y1": x1**2 + x2, "y2": x2**2 + x1}
