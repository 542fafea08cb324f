"""The measurement equation of a falling-ball viscometer."""


def viscosity(mu_c, t_m, t_c, rho_b, rho_m, rho_c):
    """Return the viscosity of a solution by that of a calibration liquid, in mPa s."""
    return {"mu_m": mu_c * t_m * (rho_b - rho_m) / (t_c * (rho_b - rho_c))}


def tangent(mu_c, t_m, t_c, rho_b, rho_m, rho_c):
    """Return the same by the equation's tangent at the stated values of the inputs."""
    nominal = viscosity(4.63, 61, 36.6, 2217, 1180, 810)["mu_m"]
    relative = (mu_c - 4.63) / 4.63 + (t_m - 61) / 61 - (t_c - 36.6) / 36.6
    solution, calibration = 2217 - 1180, 2217 - 810
    relative += (rho_b - 2217) * (1 / solution - 1 / calibration)
    relative += (rho_c - 810) / calibration - (rho_m - 1180) / solution
    return {"mu_m": nominal * (1 + relative)}
