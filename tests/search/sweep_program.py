"""A program that sweeps, for tests that kill it: results file, marks file, trials, seconds of a trial, way to run."""

import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import searched

import nuno.search as search


def main(results, marks, trials, seconds, way):
    """Sweep, and go on where the results file says."""
    grid = {"x": range(int(trials)), "marks": [marks], "seconds": [float(seconds)]}
    if way == "batch":
        search.sweep(searched.slow_squares, grid, results=results, batch=False)
        return
    with ProcessPoolExecutor(2, mp_context=get_context(way)) as pool:
        search.sweep(search.each(searched.slow_square), grid, results=results, executor=pool)


if __name__ == "__main__":
    main(*sys.argv[1:])
