"""The one estimator: equations with instruments and weights in blocks, and spectra of windows to build them from."""
