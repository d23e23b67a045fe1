# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Figures of labels with probabilities: IoU, calibration, accuracy against coverage."""
import numpy as np

BINS = 15
ACCURACY_WEIGHT = 4  # m of the score accuracy^m * coverage, as in `sst process --hand-label`


def confusion(labels, truth, count):
    """[truth, given] pixels. labels: class + 1; truth: class + 1, 0 does not count."""
    known = truth > 0
    return np.bincount((truth[known].astype(np.int64) - 1) * count + labels[known] - 1,
                       minlength=count * count).reshape(count, count)


def iou(total):
    """Per class; NaN where the truth has none."""
    union = total.sum(0) + total.sum(1) - np.diag(total)
    return np.where(total.sum(1) > 0, np.diag(total) / np.maximum(union, 1), np.nan)


def samples(prob, truth):
    """Per pixel with truth: probability of the winner and of the true class, whether they are one, entropy, Brier score.
    prob [class][y][x]; truth [y][x], class + 1 or 0."""
    known = truth.ravel() > 0
    p, t = prob.reshape(len(prob), -1)[:, known], truth.ravel()[known].astype(np.int64) - 1
    true = p[t, np.arange(t.size)]
    return {"confidence": p.max(0), "true": true, "right": p.argmax(0) == t,
            "entropy": -(p * np.log(np.maximum(p, 1e-38))).sum(0), "brier": (p * p).sum(0) - 2 * true + 1}


def reliability(confidence, right, equal_mass):
    """[(mean confidence, share right, share of the pixels)] of the bins that hold any."""
    order = np.argsort(confidence, kind="stable")
    c, r = confidence[order].astype(np.float64), right[order]
    ends = np.arange(1, BINS + 1) / BINS
    cuts = np.round(ends * c.size).astype(int) if equal_mass else np.searchsorted(c, ends, side="right")
    cuts[-1] = c.size
    return [(float(c[a:b].mean()), float(r[a:b].mean()), (b - a) / c.size)
            for a, b in zip(np.concatenate([[0], cuts[:-1]]), cuts) if b > a]


def gaps(bins):
    """Expected and largest calibration error; the latter over bins with at least 1 in 1000 of the pixels."""
    return (sum(share * abs(c - r) for c, r, share in bins),
            max(abs(c - r) for c, r, share in bins if share >= 1e-3))


def coverage_curve(entropy, right, points=60):
    """[(entropy limit, coverage, accuracy)]: share of the pixels below the limit, and of these, of those that are right."""
    order = np.argsort(entropy, kind="stable")
    cumulated = np.cumsum(right[order])
    at = np.unique(np.round(np.linspace(0.02, 1, points) * order.size).astype(int) - 1)
    return [(float(entropy[order[i]]), (i + 1) / order.size, float(cumulated[i] / (i + 1))) for i in at if i >= 0]


def at_limit(entropy, right, limit):
    """Share of the pixels kept below the limit, and share right of these."""
    kept = entropy < limit
    return float(kept.mean()), float(right[kept].mean()) if kept.any() else None


def fit_epsilon(s):
    """Entropy limit with the largest accuracy^m * coverage, coverage counting right pixels only (sst_epsilon_search)."""
    order = np.argsort(s["entropy"], kind="stable")
    h, right = s["entropy"][order].astype(np.float64), np.cumsum(s["right"][order])
    last = np.append(h[1:] > h[:-1], True) & (right > 0)  # equal entropies enter together
    kept = np.arange(1, h.size + 1)[last]
    score = (ACCURACY_WEIGHT + 1) * np.log(right[last]) - ACCURACY_WEIGHT * np.log(kept)
    i = np.flatnonzero(last)[int(score.argmax())]
    return float((h[i] + h[min(i + 1, h.size - 1)]) / 2) if i + 1 < h.size else float(np.nextafter(h[i], np.inf))


def fit_temperature(prob, truth):
    """The T that minimises the negative log likelihood of p^(1/T) / sum. prob [class][n] at T = 1; truth [n], class + 1."""
    logits, rows = np.log(np.maximum(prob, 1e-30)).astype(np.float64), np.arange(truth.size)
    grid = np.exp(np.linspace(np.log(0.4), np.log(4), 121))
    loss = [np.mean(np.logaddexp.reduce(logits / t, 0) - logits[truth.astype(np.int64) - 1, rows] / t) for t in grid]
    return float(grid[int(np.argmin(loss))])


def summary(s, limit):
    """What the report says of one run; with the point at the entropy limit where there is one."""
    out = {"right": float(s["right"].mean()), "nll": float(-np.log(np.maximum(s["true"], 1e-30)).mean()),
           "brier": float(s["brier"].mean()), "curve": coverage_curve(s["entropy"], s["right"])}
    for name, equal_mass in (("width", False), ("mass", True)):
        bins = reliability(s["confidence"], s["right"], equal_mass)
        out[name] = {"bins": bins, "ece": gaps(bins)[0], "mce": gaps(bins)[1]}
    if limit is not None:
        out["limit"] = (limit, *at_limit(s["entropy"], s["right"], limit))
    return out


def self_test():
    """Hand-worked values; an AssertionError names what is wrong."""
    def near(value, want, what):
        assert abs(value - want) < 1e-6, f"self-test: {what} is {value}, not {want}"

    truth, given = np.array([[1, 1, 2, 0]]), np.array([[1, 2, 2, 2]])
    total = confusion(given, truth, 3)
    assert total.tolist() == [[1, 1, 0], [0, 1, 0], [0, 0, 0]], "self-test: confusion"
    assert iou(total)[:2].tolist() == [0.5, 0.5] and np.isnan(iou(total)[2]), "self-test: IoU"
    s = samples(np.array([[[0.75, 0.5]], [[0.25, 0.5]]]), np.array([[1, 2]]))
    near(s["brier"][0], 0.25 ** 2 + 0.25 ** 2, "Brier score")
    near(s["entropy"][0], 0.56233514, "entropy")
    assert s["right"].tolist() == [True, False], "self-test: winner"
    # 4 pixels at 0.9, 3 of them right; 6 at 0.6, 3 right: gaps 0.15 and 0.1 by width, ECE 0.4 * 0.15 + 0.6 * 0.1
    confidence, right = np.array([0.9] * 4 + [0.6] * 6), np.array([1, 1, 1, 0, 1, 1, 1, 0, 0, 0], bool)
    near(gaps(reliability(confidence, right, False))[0], 0.12, "ECE, equal width")
    near(gaps(reliability(confidence, right, False))[1], 0.15, "largest error, equal width")
    mass = reliability(np.arange(30) / 30, np.arange(30) >= 15, True)
    assert len(mass) == 15 and all(abs(b[2] - 1 / 15) < 1e-9 for b in mass), "self-test: bins of equal mass"
    near(mass[7][1], 0.5, "share right in the middle bin")
    # sorted: right, right, wrong, right: scores 1/4, 2/4, (2/3)^4 2/4, (3/4)^4 3/4
    s = {"entropy": np.array([0.2, 0.1, 0.4, 0.8]), "right": np.array([True, True, False, True])}
    near(fit_epsilon(s), 0.3, "entropy limit")
    near(at_limit(s["entropy"], s["right"], 0.5)[1], 2 / 3, "accuracy at a limit")
    near(coverage_curve(s["entropy"], s["right"], 4)[-1][2], 0.75, "end of the curve")
    # logits +-1 with 3 of 4 right: the best p is 3/4, that is 2 / T = log 3
    p = 1 / (1 + np.exp(-2.0))
    near(round(fit_temperature(np.array([[p] * 4, [1 - p] * 4]), np.array([1, 1, 1, 2])), 1), round(2 / np.log(3), 1),
         "temperature")
