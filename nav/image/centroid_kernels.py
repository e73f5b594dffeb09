"""The loops of `centroid`, whose symbols and equation numbers they use."""

import numpy as np

from dockair.kernels import njit

_MIN_BACKGROUND_PIXELS = 12  # fewer say less about b than the whole frame does
_WINDOW_RADII = 1.9  # R in equivalent radii of the blob: least error from 2 m to 30 m
_CLIPPED_WINDOW_RADII = 2.8
_LEAST_WINDOW_PX = 1.9
_CORRELATION = 2.0  # neighbouring pixels of structure go together: their variance counts as often
_RINGS_SHARE = 0.01  # of the peak: rms of the lens's rings two and three pixels outside a blob
_ROUND = 0.07  # of both second moments: what they differ by in a single point
_SIGNIFICANT = 1.5  # s_a
_PHASES_PX = 4  # clipped pixels from which on the error no longer grows
_STEPS = 12  # Newton's; four are the rule
_CONVERGED_PX = 1e-5


@njit(cache=True)
def _paint(row, start, stop, top, left, rows, columns):  # type: ignore[no-untyped-def]
    """Patch of 2 for the blob's pixels, 1 for those that touch it, 0 elsewhere."""
    patch = np.zeros((rows, columns), np.uint8)
    for k in range(len(row)):
        for i in range(max(row[k] - 1 - top, 0), min(row[k] + 2 - top, rows)):
            for j in range(max(start[k] - 1 - left, 0), min(stop[k] + 1 - left, columns)):
                patch[i, j] = max(patch[i, j], 1)
        patch[row[k] - top, start[k] - left : stop[k] - left] = 2
    return patch


@njit(cache=True)
def _leave_out_uphill(image, patch, top, left, threshold):  # type: ignore[no-untyped-def]
    """Make 0 what touches the blob, is above the threshold and brighter than all of the blob that it touches.

    That is a bright surface's beside the spot, which was cut off from it.
    """
    for i in range(patch.shape[0]):
        for j in range(patch.shape[1]):
            level = image[top + i, left + j]
            if patch[i, j] != 1 or level <= threshold:
                continue
            uphill = True
            for a in range(max(i - 1, 0), min(i + 2, patch.shape[0])):
                for b in range(max(j - 1, 0), min(j + 2, patch.shape[1])):
                    if patch[a, b] == 2 and image[top + a, left + b] >= level:
                        uphill = False
            if uphill:
                patch[i, j] = 0


@njit(cache=True)
def _background(image, patch, top, left, threshold):  # type: ignore[no-untyped-def]
    """Mean and variance of the patch's pixels outside the blob and not above the threshold, and their number."""
    total, squares, n = 0.0, 0.0, 0
    for i in range(patch.shape[0]):
        for j in range(patch.shape[1]):
            level = float(image[top + i, left + j])
            if patch[i, j] == 0 and level <= threshold:
                total += level
                squares += level * level
                n += 1
    mean = total / max(n, 1)
    return mean, squares / max(n, 1) - mean * mean, n


@njit(cache=True)
def _elongation(patch):  # type: ignore[no-untyped-def]
    """Ratio of the axes of the blob's pixels, each a unit square (hence the 1/12)."""
    n, si, sj, sii, sij, sjj = 0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(patch.shape[0]):
        for j in range(patch.shape[1]):
            if patch[i, j] == 2:
                n += 1
                si += i
                sj += j
                sii += i * i
                sij += i * j
                sjj += j * j
    a, b, c = sii / n - (si / n) ** 2 + 1 / 12, sij / n - si * sj / n**2, sjj / n - (sj / n) ** 2 + 1 / 12
    root = np.sqrt((a - c) ** 2 + 4 * b * b)
    return np.sqrt((a + c + root) / max(a + c - root, 1e-9))


@njit(cache=True)
def _variance(level, background, model, texture):  # type: ignore[no-untyped-def]
    """Eq. (3)."""
    gain, noise, spread = model
    return gain * level + noise * noise + (spread * (level - background)) ** 2 + texture


@njit(cache=True)
def _weighted(image, patch, top, left, model, background, texture, background_variance):  # type: ignore[no-untyped-def]
    """Eqs. (1)-(3) on one patch, in its coordinates: u, v, sigma, flux."""
    flux, su, sv = 0.0, 0.0, 0.0
    for i in range(patch.shape[0]):
        for j in range(patch.shape[1]):
            if patch[i, j]:
                w = image[top + i, left + j] - background
                flux += w
                su += w * j
                sv += w * i
    if flux <= 0.0:
        return 0.0, 0.0, 0.0, flux
    u, v = su / flux, sv / flux
    var_u, var_v, du, dv = 0.0, 0.0, 0.0, 0.0
    for i in range(patch.shape[0]):
        for j in range(patch.shape[1]):
            if patch[i, j]:
                variance = _variance(float(image[top + i, left + j]), background, model, texture)
                var_u += (j - u) ** 2 * variance
                var_v += (i - v) ** 2 * variance
                du += j - u
                dv += i - v
    var_u += du * du * background_variance
    var_v += dv * dv * background_variance
    return u, v, np.sqrt(max(var_u, var_v)) / flux, flux


@njit(cache=True)
def _start(image, patch, top, left, threshold, saturation):  # type: ignore[no-untyped-def]
    """Centre of what the blob's pixels have above the threshold, its sum, their number, the brightest, the clipped."""
    total, u, v, n, peak, clipped = 0.0, 0.0, 0.0, 0, 0, 0
    for i in range(patch.shape[0]):
        for j in range(patch.shape[1]):
            if patch[i, j] == 2:
                level = int(image[top + i, left + j])
                w = float(level - threshold)
                total += w
                u += w * j
                v += w * i
                n += 1
                peak = max(peak, level)
                clipped += level >= saturation
    return u / total, v / total, total, n, peak, clipped


@njit(cache=True)
def _equation(image, patch, top, left, u, v, radius, background):  # type: ignore[no-untyped-def]
    """Eq. (4) and its derivative J, of both coordinates: the sums of every step."""
    eu, ev, ju, jv = 0.0, 0.0, 0.0, 0.0
    for i in range(max(int(np.ceil(v - radius)), 0), min(int(v + radius) + 1, patch.shape[0])):
        for j in range(max(int(np.ceil(u - radius)), 0), min(int(u + radius) + 1, patch.shape[1])):
            dv, du = i - v, j - u
            root = 1.0 - (du * du + dv * dv) / radius**2
            if root <= 0.0 or not patch[i, j]:
                continue
            G, w = root * root, image[top + i, left + j] - background
            eu += G * w * du
            ev += G * w * dv
            ju += w * (G - 4.0 * root * du * du / radius**2)
            jv += w * (G - 4.0 * root * dv * dv / radius**2)
    return eu, ev, ju, jv


@njit(cache=True)
def _spread(image, patch, top, left, u, v, radius, model, background, texture):  # type: ignore[no-untyped-def]
    """Variances of Eq. (4) in both coordinates, and that of a coordinate by what the spot has merged with, Eq. (6)."""
    var_u, var_v, uu, vv, uv, weight, noise = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(max(int(np.ceil(v - radius)), 0), min(int(v + radius) + 1, patch.shape[0])):
        for j in range(max(int(np.ceil(u - radius)), 0), min(int(u + radius) + 1, patch.shape[1])):
            dv, du = i - v, j - u
            root = 1.0 - (du * du + dv * dv) / radius**2
            if root <= 0.0:
                continue
            level = float(image[top + i, left + j])
            G, w = root * root, level - background
            variance = _variance(level, background, model, texture)
            uu += G * w * du * du  # of all pixels in the window, whatever they belong to
            vv += G * w * dv * dv
            uv += G * w * du * dv
            weight += G * w
            # structure beside the LED is what is looked for here, not noise
            noise += (G * (du * du + dv * dv)) ** 2 * (variance - texture)
            if patch[i, j]:
                var_u += G * G * du * du * variance
                var_v += G * G * dv * dv * variance
    if weight <= 0.0:
        return var_u, var_v, 0.0
    a = np.sqrt((uu - vv) ** 2 + 4.0 * uv**2)
    return var_u, var_v, max(0.0, a - _SIGNIFICANT * np.sqrt(noise) - _ROUND * (uu + vv)) / weight


@njit(cache=True)
def _windowed(image, patch, top, left, start, radius, model, background, texture):  # type: ignore[no-untyped-def]
    """Eqs. (4) to (6) from a start, in the patch's coordinates: u, v, sigma; sigma -1 if the steps go astray."""
    u, v = start
    for _ in range(_STEPS):
        last = u, v  # where all of the sums are taken
        eu, ev, ju, jv = _equation(image, patch, top, left, u, v, radius, background)
        if ju <= 0.0 or jv <= 0.0:
            return u, v, -1.0
        du, dv = eu / ju, ev / jv
        u, v = u + du, v + dv
        if (u - start[0]) ** 2 + (v - start[1]) ** 2 > 0.25 * radius**2:
            return u, v, -1.0
        if abs(du) + abs(dv) < _CONVERGED_PX:
            break
    var_u, var_v, merged = _spread(image, patch, top, left, last[0], last[1], radius, model, background, texture)
    return u, v, np.sqrt(max(var_u / ju**2, var_v / jv**2) + merged)


@njit(cache=True)
def _centre(image, patch, top, left, threshold, model, levels, windowed, saturation):  # type: ignore[no-untyped-def]
    """u, v, sigma in the patch's coordinates, flux, peak, clipped pixels; `levels` background, variance, number."""
    background, spread, n = levels
    own = _variance(background, background, model, 0.0)
    su, sv, above, area, peak, clipped = _start(image, patch, top, left, threshold, saturation)
    # the lens's own rings vary too, but alike on all sides: they are no texture
    rings = (_RINGS_SHARE * (peak - background)) ** 2
    texture = 0.0 if clipped else _CORRELATION * max(spread - own - rings, 0.0)
    u, v, sigma, flux = _weighted(image, patch, top, left, model, background, texture, (own + texture) / n)
    if windowed:
        radius = max((_CLIPPED_WINDOW_RADII if clipped else _WINDOW_RADII) * np.sqrt(area / np.pi), _LEAST_WINDOW_PX)
        found = _windowed(image, patch, top, left, (su, sv), radius, model, background, texture)
        if found[2] >= 0.0:
            u, v, sigma = found
    if flux <= 0.0 or not (-0.5 <= u <= patch.shape[1] - 0.5 and -0.5 <= v <= patch.shape[0] - 0.5):
        u, v, sigma, flux = su, sv, np.sqrt(max(patch.shape[0], patch.shape[1]) ** 2 / 12.0), above
    return u, v, sigma, flux, peak, clipped


@njit(cache=True)
def measure(image, row, start, stop, offset, threshold, model, floors, given_background, local, windowed, saturation):  # type: ignore[no-untyped-def]
    """Of every component u and v (n, 2), sigma, flux, peak, elongation, and whether it is clipped (n,).

    `model` is g, s_n, p; `floors` are that of a blob that is not clipped and that of one clipped pixel.
    """
    n, margin = len(offset) - 1, 3
    centroids, sigmas, fluxes, elongations = np.empty((n, 2)), np.empty(n), np.empty(n), np.empty(n)
    peaks, is_clipped = np.empty(n, np.int64), np.empty(n, np.bool_)
    for c in range(n):
        first, last = offset[c], offset[c + 1]
        top, bottom = max(row[first] - margin, 0), min(row[last - 1] + 1 + margin, image.shape[0])
        left = max(start[first:last].min() - margin, 0)
        right = min(stop[first:last].max() + margin, image.shape[1])
        patch = _paint(row[first:last], start[first:last], stop[first:last], top, left, bottom - top, right - left)
        _leave_out_uphill(image, patch, top, left, threshold[c])
        levels = _background(image, patch, top, left, threshold[c])
        if not local or levels[2] < _MIN_BACKGROUND_PIXELS:
            # none above the threshold: the blob's pixels would have less than nothing
            levels = min(given_background[c], float(threshold[c])), 0.0, 1 << 30
        u, v, sigma, flux, peak, clipped = _centre(
            image, patch, top, left, threshold[c], model, levels, windowed, saturation
        )
        floor = floors[1] * np.sqrt(min(clipped, _PHASES_PX)) if clipped else floors[0]
        centroids[c, 0], centroids[c, 1], sigmas[c] = u + left, v + top, np.sqrt(sigma * sigma + floor * floor)
        fluxes[c], peaks[c], elongations[c], is_clipped[c] = flux, peak, _elongation(patch), clipped > 0
    return centroids, sigmas, fluxes, peaks, elongations, is_clipped
