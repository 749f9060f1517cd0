"""Kalman filter of RAM (twins) in the form of the textbooks, without noise classifier."""

import numpy as np

from rl.twins import filter_step as motion


def kalman_filter(members, way, measurement, variance, deviation, sample_time, directions):
    """Mean and covariance over time of X = [c, d, b] for one record, in the textbook's form."""
    count, rank = directions.shape
    mean = np.zeros(rank + 2)
    covariance = np.diag([*np.ones(rank), motion.FIRST_ERROR_DEG2, deviation**2])
    means, covariances, predictions = [], [], []
    for now, gone, y in zip(members, way, measurement, strict=True):
        transition = np.eye(rank + 2)
        transition[rank, rank] = np.exp(-gone / motion.MEMORY_MM)
        process = np.zeros((rank + 2, rank + 2))
        process[range(rank), range(rank)] = motion.MEMBERS_PER_MM * gone
        process[rank, rank] = motion.GROWTH_DEG2_PER_MM * gone + motion.GROWTH_DEG2_PER_S * sample_time
        process[rank + 1, rank + 1] = motion.ZERO_PER_S * sample_time * deviation**2
        mean, covariance = transition @ mean, transition @ covariance @ transition.T + process
        seen_as = np.concatenate([(now - now.mean()) / np.sqrt(count - 1) @ directions, [1, 1]])
        predictions.append(now.mean() + seen_as @ mean)
        if not np.isnan(y):
            gain = covariance @ seen_as / (seen_as @ covariance @ seen_as + variance)
            mean = mean + gain * (y - predictions[-1])
            covariance = (np.eye(rank + 2) - np.outer(gain, seen_as)) @ covariance
        means.append(mean)
        covariances.append(covariance)
    return np.array(means), np.array(covariances)
