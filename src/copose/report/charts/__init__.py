"""Charts of quantities: exact sets, torque shares, motions along time."""
