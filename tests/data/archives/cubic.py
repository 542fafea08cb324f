"""A model with a module beside it, which it imports where it needs it."""


def cubic(x1: float, x2: float) -> dict[str, float]:
    from powers import cube

    return {"y": cube(x2) + x1}
