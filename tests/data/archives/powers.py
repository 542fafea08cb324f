"""What the model of this folder imports."""


def cube(x: float) -> float:
    return x**3
