"""Marginal likelihood of a structure: how well it explains the recordings, with the price of its freedom.

    y = X b + Z u + e,   b ~ N(0, T^2),  u ~ N(0, s_l^2) by groups l,  e ~ N(0, sigma_b^2) in band b

y is what the fitted structure leaves, X its tangents, Z what friction laws cannot agree on. Noise levels sigma_b and
sizes s_l are estimated (expectation-maximisation), sizes with half-normal priors p_l:

    M = sum_b c_b X'X_b / sigma_b^2 + P,     P = diag(1/T^2, 1/s^2),     c_b = effective rows / rows of band b
    sigma_b^2 <- (|left_b|^2 + tr M^-1 X'X_b) / rows_b
    s^2 <- p^2/2 (-K + sqrt(K^2 + 4 K m / p^2)),   m = mean of u^2 + var u over the K columns of the group
    log L = -sum_b n_b ln sigma_b - (left' left + u' P u)/2 - ln|M|/2 + ln|P|/2 - sum_l (s_l/p_l)^2/2

Reference: MacKay, Neural Computation 4 (1992) 415; coarsening c_b: Miller and Dunson, JASA 114 (2019) 1113.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.estimation.kernels import done, library
from cosim.estimation.prepare import Array

ROUNDS = 6


@dataclass(frozen=True)
class Group:
    """Columns whose coefficients share one unknown size, with the scale of its half-normal prior."""

    columns: Any
    prior: float


@dataclass(frozen=True)
class Marginal:
    """Result: log-likelihood, noise of each band, sizes of the groups, coefficients."""

    log_likelihood: float
    noise: Array
    sizes: Array
    beta: Array


def marginal(
    grams: Array,
    free: Array,
    groups: Sequence[Group],
    count: Array,
    effective: Array,
    floor: Array,
    start: Marginal | None = None,
    rounds: int = ROUNDS,
) -> Marginal:
    """Compute the marginal likelihood from Gram matrices of each band.

    Args:
        grams: (bands, 1 + n, 1 + n), the target first.
        free: prior standard deviation of each of the n columns that are in no group.
        groups: nuisance columns (numbers from 0 among the n).
        count: rows of each band.
        effective: independent rows of each band.
        floor: least noise variance of each band.
        start: noise and sizes to start from.
        rounds: how often they are renewed.
    """
    floored = np.maximum(grams[:, 0, 0] / count, floor)
    noise = floored if start is None else start.noise
    sizes = np.array([group.prior for group in groups]) if start is None else start.sizes
    variance = np.square(np.clip(free, 1e-150, 1e150))
    rows = count, effective, floor
    return (_compiled if library() else _interpreted)(grams, variance, groups, rows, (noise, sizes), rounds)


Rows = tuple[Array, Array, Array]
"""Of each band: rows, independent rows, least noise variance."""


def _compiled(
    grams: Array, variance: Array, groups: Sequence[Group], rows: Rows, start: tuple[Array, Array], rounds: int
) -> Marginal:
    kernels = library()
    assert kernels
    edges = np.cumsum([0, *(len(group.columns) for group in groups)])
    columns = np.concatenate([np.zeros(0, np.int64), *(group.columns for group in groups)]).astype(np.int64)
    noise, sizes = (np.array(one, float) for one in start)
    beta, found = np.empty(len(variance)), np.empty(1)
    prior = np.array([group.prior for group in groups], float)
    grams, *own = (np.ascontiguousarray(one, float) for one in (grams, *rows))
    at = [one.ctypes.data for one in (grams, variance, columns, edges, prior, *own, noise, sizes, beta, found)]
    done(
        kernels.marginal_run(*at[:2], len(grams), len(variance), *at[2:5], len(groups), *at[5:8], rounds, *at[8:]),
        "Gram matrices are not positive definite",
    )
    return Marginal(float(found[0]), noise, sizes, beta)


def _interpreted(
    grams: Array, variance: Array, groups: Sequence[Group], rows: Rows, start: tuple[Array, Array], rounds: int
) -> Marginal:
    """What `marginal_run` does, by NumPy."""
    yy, xy, xx = grams[:, 0, 0], grams[:, 1:, 0], np.ascontiguousarray(grams[:, 1:, 1:])
    flat = xx.reshape(len(xx), -1)  # one matrix product over bands is several times faster than einsum
    (count, effective, floor), (noise, sizes) = rows, start
    share = effective / np.maximum(count, 1e-300)
    for last in range(rounds + 1):
        for group, size in zip(groups, sizes, strict=True):
            variance[group.columns] = max(size, 1e-6 * group.prior) ** 2
        weight = share / noise
        normal = (weight @ flat).reshape(xx.shape[1:]) + np.diag(1 / variance)
        scale = 1 / np.sqrt(np.diag(normal))
        factor = np.linalg.cholesky(normal * np.outer(scale, scale) + 1e-12 * np.eye(len(scale)))
        inverse = np.linalg.inv(factor) * scale
        covariance = inverse.T @ inverse
        beta = covariance @ (weight @ xy)
        left = yy - 2 * xy @ beta + flat @ np.outer(beta, beta).ravel()
        if last == rounds:
            break
        noise = np.maximum((np.maximum(left, 0) + flat @ covariance.ravel()) / count, floor)
        sizes = np.array([_size(beta[g.columns], np.diag(covariance)[g.columns], g.prior) for g in groups])
    log_normal = 2 * float(np.sum(np.log(np.diag(factor)) - np.log(scale)))
    penalty = sum((size / group.prior) ** 2 for size, group in zip(sizes, groups, strict=True)) / 2
    fit = float(np.sum(effective * np.log(noise)) + weight @ left + beta @ (beta / variance)) / 2
    return Marginal(-fit - log_normal / 2 - float(np.sum(np.log(variance))) / 2 - penalty, noise, sizes, beta)


def _size(u: Array, var: Array, prior: float) -> float:
    many, mean = len(u), float(np.mean(u**2 + var))
    return float(np.sqrt(prior**2 / 2 * (-many + np.sqrt(many**2 + 4 * many * mean / prior**2))))
