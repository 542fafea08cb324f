"""The rod and target of FFI/RAPPORT-2000/05876, Table 3.1, with R = 17 mm, and known answers."""

ROD = {
    "projectile_density": 17_500.0,
    "projectile_yield_limit": 1.65e9,
    "projectile_length": 0.16,
    "impact_velocity": 1400.0,
    "projectile_sound_speed": 3071.0,
    "target_density": 2500.0,
    "target_yield_limit": 400e6,
    "plasticity_radius": 0.1,
    "crater_radius": 0.017,
    "smoothing": 0.0,
}

# Its course by depth in m, of Taylor series of high order.
COURSE = ("time", "nose_velocity", "tail_velocity", "length", "plastic_extent")
KNOWN_POINTS = {
    0.05: (46.067e-6, 1020.611, 1367.958, 0.1462320, 2.80922e-3),
    0.2: (200.200e-6, 920.739, 1228.831, 0.0953474, 2.76201e-3),
    0.4: (456.296e-6, 583.986, 734.381, 0.0326935, 2.12576e-3),
}
