#!/usr/bin/env python3
"""Classifier two-sample test of posterior samples against the reference: 0.5 perfect, 1 useless.

As in the sbibm benchmark (Lueckmann et al., AISTATS 2021): both sets scaled by the reference's mean and standard
deviation, a multi-layer perceptron of two hidden layers of 10 d units, accuracy over 5 shuffled folds. --linear: a linear
classifier instead, enough for Gaussians that differ in their means, and quick.

    bench/c2st.py [--points N] [--jobs N] [--linear] <directory of <i>.method and <i>.reference> ...
"""
import argparse
import pathlib
import warnings
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.exceptions import ConvergenceWarning
from sklearn.model_selection import KFold, cross_val_score
from sklearn.neural_network import MLPClassifier

SEED = 1


def c2st(files):
    reference, method = (np.loadtxt(f)[: files[2]] for f in files[:2])
    centre, scale = reference.mean(axis=0), reference.std(axis=0, ddof=1)
    data = np.concatenate([(reference - centre) / scale, (method - centre) / scale])
    label = np.concatenate([np.zeros(len(reference)), np.ones(len(method))])
    hidden = 10 * data.shape[1]
    classifier = MLPClassifier((hidden, hidden), activation="relu", solver="adam", max_iter=10000, random_state=SEED)
    if files[3]:
        classifier = LinearDiscriminantAnalysis()
    folds = KFold(n_splits=5, shuffle=True, random_state=SEED)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        return float(cross_val_score(classifier, data, label, cv=folds, scoring="accuracy").mean())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("directories", nargs="+", type=pathlib.Path)
    parser.add_argument("--points", type=int, default=10000, help="samples of each set, at most")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--linear", action="store_true", help="classifier")
    arguments = parser.parse_args()
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for directory in arguments.directories:
            methods = sorted(directory.glob("*.method"), key=lambda path: int(path.stem))
            work = [(m.with_suffix(".reference"), m, arguments.points, arguments.linear) for m in methods]
            scores = list(pool.map(c2st, work))
            each = " ".join(f"{score:.3f}" for score in scores)
            print(f"{directory.name:40} mean {np.mean(scores):.3f}  {each}", flush=True)


if __name__ == "__main__":
    main()
