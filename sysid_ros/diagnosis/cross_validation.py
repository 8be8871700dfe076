"""What each term gains on parts of the recordings that it was not fitted to."""

from __future__ import annotations

import numpy as np

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.term import Term
from sysid_ros.sample import FloatArray


def predictive_gains(problem: Problem, fit: Fit) -> dict[Term, float]:
    """Likelihood of left-out segments that each term gains, the others adjusted, with the noise of the fit.

    Every segment is predicted with the parameters that all others give. What is known of these before any data counts once: links
    far from their masses would predict as well as the error of one of them, and are not likely.
    """
    segments = problem.band.segment
    count = len(fit.theta)
    prior = np.concatenate([np.zeros(0), *(t.prior for t in fit.terms), problem.prior if fit.inexact else np.zeros(0)])
    G, b = np.zeros((segments.max() + 1, count, count)), np.zeros((segments.max() + 1, count))
    for j, (index, X) in fit.blocks.items():
        weight = 1.0 / fit.variance[:, j]
        for s in range(len(G)):
            rows = segments == s
            weighted = X[rows] * weight[rows, None]
            G[s][np.ix_(index, index)] += weighted.T @ X[rows]
            b[s][index] += weighted.T @ problem.y[rows, j]
    whole = _left_out(G, b, prior, np.arange(count))
    out = {}
    for term, where in zip(fit.terms, fit.slices, strict=True):
        keep = np.delete(np.arange(count), np.arange(where.start, where.stop))
        out[term] = whole - _left_out(G, b, prior, keep)
    return out


def _left_out(G: FloatArray, b: FloatArray, prior: FloatArray, keep: np.ndarray[tuple[int], np.dtype[np.intp]]) -> float:
    """Log-likelihood of the left-out segments up to a constant."""
    G, b = G[:, keep[:, None], keep], b[:, keep]
    total, score = G.sum(axis=0) + np.diag(prior[keep]), b.sum(axis=0)
    value = 0.0
    for Gs, bs in zip(G, b, strict=True):
        information = total - Gs
        scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-30))
        scaled = information * scale[:, None] * scale
        scaled[np.diag_indices(len(scaled))] += 1e-8
        theta = scale * np.linalg.solve(scaled, scale * (score - bs))
        value += float(theta @ bs - 0.5 * theta @ Gs @ theta) - 0.5 * float(theta**2 @ prior[keep]) / len(G)
    return value
