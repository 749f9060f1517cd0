"""Random walks of the states of a filter on twins: weights c, unexplained error d, the sensor's zero b."""

FIRST_ERROR_DEG2 = 0.02  # variance of d before anything is measured
MEMORY_MM = 5.0  # travel of the tendon after which d is forgotten
GROWTH_DEG2_PER_MM, GROWTH_DEG2_PER_S = 0.05, 0.0065  # of the variance of d
MEMBERS_PER_MM = 5e-4  # growth of the variances of c, which stay adaptive for hours
ZERO_PER_S = 2e-5  # growth of the variance of b, as a share of that before anything is measured
