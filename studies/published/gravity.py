"""The force of gravity between two masses."""

CONSTANT = 6.67384e-11  # m³ kg⁻¹ s⁻², as the exercise has it


def force(m_1, m_2, r):
    """Return the force in N between masses in kg at a distance in m."""
    return {"force": CONSTANT * m_1 * m_2 / r**2}
