"""Random walks of what a filter on twins knows: weights c, the error d that no twin explains, the zero b."""

FIRST_ERROR_DEG2 = 0.02  # variance of d before anything is measured
MEMORY_MM = 5.0  # way of the tendon after which d is forgotten
GROWTH_DEG2_PER_MM, GROWTH_DEG2_PER_S = 0.05, 0.0065  # of the variance of d
MEMBERS_PER_MM = 5e-4  # growth of the variances of c: what keeps them awake for hours
ZERO_PER_S = 2e-5  # growth of the variance of b, as a share of that before anything is measured
