"""Pictures in the manner of the thesis's Fig. 3.10: a piece of displacement and force, spectrograms of the force."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import spectrogram

from phil_study.drawing import save, subplots
from validate.realtime_signals import Signals

Array = NDArray[np.float64]

SNIPPET = 2.0
"""Length of the piece that is shown, s."""
HIGHEST = 60.0
"""Highest frequency of the spectrograms, Hz."""
_WINDOW = 512
"""Samples of a spectrogram's window, about a second."""


def power(signals: Signals) -> tuple[Array, Array, Array]:
    """Return frequencies (Hz), times (s) and power density of the force (dB over 1 N^2/Hz), (frequencies, times)."""
    samples = min(_WINDOW, signals.F.size)
    f, t, density = spectrogram(
        signals.F, 1.0 / signals.ts, "hann", samples, samples - max(1, samples // 16), detrend="constant"
    )
    shown = f <= HIGHEST
    return f[shown], t + signals.t[0], 10.0 * np.log10(density[shown] + 1e-12)


def draw(title: str, truth: Signals, models: Mapping[str, Signals], path: Path) -> None:
    """Draw the reference (grey, dashed) and the real-time models, all at the same instants and not filtered."""
    figure, axes = subplots(3 + len(models), 1, figsize=(10, 3.0 * (3 + len(models))), layout="constrained")
    first = truth.t[0]
    piece = truth.t < first + SNIPPET
    for axis, name, scale in ((axes[0], "w", 1e3), (axes[1], "F", 1.0)):
        for number, (label, model) in enumerate(models.items()):
            axis.plot(model.t[piece], scale * getattr(model, name)[piece], lw=1.2, color=f"C{number}", label=label)
        axis.plot(truth.t[piece], scale * getattr(truth, name)[piece], "--", lw=1.2, color="0.4", label="reference")
        axis.grid(alpha=0.3)
        axis.set_xlim(first, first + SNIPPET)
    axes[0].set(ylabel="displacement in mm", title=title)
    axes[0].legend(fontsize=8, ncols=1 + len(models))
    axes[1].set(ylabel="contact force in N", xlabel="time in s")
    every = {"reference": power(truth)} | {label: power(model) for label, model in models.items()}
    top = max(float(density.max()) for _, _, density in every.values())
    for axis, (label, (f, t, density)) in zip(axes[2:], every.items(), strict=True):
        image = axis.pcolormesh(t, f, density, vmin=top - 60.0, vmax=top, cmap="viridis", rasterized=True)
        axis.set(ylabel="frequency in Hz", title=f"contact force, {label}", xlim=(every["reference"][1][[0, -1]]))
        figure.colorbar(image, ax=axis, label="dB over 1 N$^2$/Hz")
    axes[-1].set_xlabel("time in s")
    save(figure, path)
