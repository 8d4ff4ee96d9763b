"""The studio of render_bench for other renderers, its tone curve to 8 bits, and the comparison of pictures."""
import flip_evaluator
import numpy as np

SUN, SKY, EXPOSURE, SOFTNESS = 3.0 * np.array([1.0, 0.965, 0.91]), [0.93, 1.0, 1.10], 0.42, 0.03
COLOURS = [[0.80, 0.30, 0.20], [0.25, 0.45, 0.75], [0.85, 0.70, 0.25], [0.80, 0.80, 0.78]]
FROM, AT, DIRECTION = [0.4, -4.2, 3.0], [0, 0, 0.3], np.array([-0.45, 0.35, -1.0])


def linear(c):
    c = np.asarray(c)
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def developed(radiance):
    x = np.maximum(radiance, 0) * EXPOSURE
    v = np.clip(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0, 1)
    return np.round(255 * np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)).astype(np.uint8)


def compare(reference, image):
    error = np.mean((reference.astype(float) - image.astype(float)) ** 2)
    _, flip, _ = flip_evaluator.evaluate(reference.astype(np.float32) / 255, image.astype(np.float32) / 255, "LDR")
    return {"psnr_db": round(float(10 * np.log10(255 ** 2 / error)), 2), "flip": round(float(flip), 4)}
