"""Compiled kernels of the poses from depth: planes in depth images, and the pose of a frame on others."""

from __future__ import annotations

import numpy as np
from numba import njit

from recon.dense.depth import pixel_sigma
from recon.dense.noise import GOOD_SENSOR

GOOD = GOOD_SENSOR.curve  # poses come first: the recording's own noise is measured with them


@njit(cache=True, nogil=True)
def block_means(depth, step, skip):  # type: ignore[no-untyped-def]
    """Inverse depth (h, w) 1/m of blocks of step x step pixels, of which each `skip`-th is read; 0 where few
    of them are known or they lie on both sides of a step."""
    h, w = depth.shape[0] // step, depth.shape[1] // step
    out = np.zeros((h, w))
    for y in range(h):
        for x in range(w):
            total, known, read, low, high = 0.0, 0, 0, np.inf, 0.0
            for v in range(y * step, (y + 1) * step, skip):
                for u in range(x * step, (x + 1) * step, skip):
                    z = depth[v, u]
                    read += 1
                    if z > 0:
                        total += 1.0 / z
                        known += 1
                        low, high = min(low, z), max(high, z)
            if 4 * known >= read and high - low < 0.1 * low:
                out[y, x] = total / known
    return out


@njit(cache=True, nogil=True)
def planes(inverse, lens, reach, most):  # type: ignore[no-untyped-def]
    """Planes (h, w, 4) float32: unit normal n towards the camera and n x on the plane; NaN without a plane.

    The inverse depth of a plane is linear in the pixel: it is fitted to (2 reach + 1)^2 pixels, half of them
    known, and counts where the fit leaves at most the share `most` of depth. lens: fx, fy, cx, cy.
    """
    h, w = inverse.shape
    out = np.full((h, w, 4), np.float32(np.nan), dtype=np.float32)
    for y in range(reach, h - reach):
        for x in range(reach, w - reach):
            c = inverse[y, x]
            if c <= 0:
                continue
            n, su, sv, suu, suv, svv, si, sui, svi, sii = 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for dv in range(-reach, reach + 1):
                for du in range(-reach, reach + 1):
                    i = inverse[y + dv, x + du]
                    if i > 0 and abs(i - c) < 0.15 * c:
                        i -= c
                        n += 1
                        su, sv, si = su + du, sv + dv, si + i
                        suu, suv, svv = suu + du * du, suv + du * dv, svv + dv * dv
                        sui, svi, sii = sui + du * i, svi + dv * i, sii + i * i
            if 2 * n < (2 * reach + 1) ** 2:
                continue
            mu, mv, mi = su / n, sv / n, si / n
            uu, uv, vv = suu / n - mu * mu, suv / n - mu * mv, svv / n - mv * mv
            ui, vi, ii = sui / n - mu * mi, svi / n - mv * mi, sii / n - mi * mi
            det = uu * vv - uv * uv
            if det < 1e-3:
                continue
            a, b = (vv * ui - uv * vi) / det, (uu * vi - uv * ui) / det
            at = c + mi - a * mu - b * mv
            if at <= 0 or ii - a * ui - b * vi > (most * at) ** 2:
                continue
            # 1/Z = at + a (u - x) + b (v - y) with u = fx X/Z + cx gives 1 = a fx X + b fy Y + (at + a (cx -
            # x) + b (cy - y)) Z
            nx, ny, nz = a * lens[0], b * lens[1], at + a * (lens[2] - x) + b * (lens[3] - y)
            size = np.sqrt(nx * nx + ny * ny + nz * nz)
            out[y, x, 0], out[y, x, 1], out[y, x, 2] = -nx / size, -ny / size, -nz / size
            out[y, x, 3] = -1.0 / size
    return out


@njit(cache=True, nogil=True, inline="always")
def _area(z):  # type: ignore[no-untyped-def]
    """Area of a pixel at depth z, m^2 up to a factor; at most that at 3 m, beyond which depth says little."""
    return min(max(z, 0.3), 3.0) ** 2


@njit(cache=True, nogil=True)
def depth_system(poses, rows, points, normals, plane, lens, gate, h, g, held):  # type: ignore[no-untyped-def]
    """Adds normal equations of points on planes to h (6, 6, upper) and g (6), T <- T exp(d); the agreement.

    poses (k, 4, 4): of the frame's camera in those of the references, `rows` (k,) of plane (n, h, w, 4).
    points, normals (m, 3): of the frame. gate: standard deviations at which doubt sets in. A point counts by
    its area and by the square of its mean agreement with all references that would see it: what moves agrees
    with the last ones only. held (3, 3) gathers the shift's information from normals of both frames, whose
    noise is independent: those of one frame would seem to hold a shift along a bare wall.
    """
    total = 0.0
    height, width, count = plane.shape[1], plane.shape[2], len(rows)
    jacobian, residual, agree = np.zeros((count, 6)), np.zeros(count), np.zeros(count)
    for i in range(len(points)):
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        sigma = pixel_sigma(pz, GOOD)
        n, good = 0, 0.0
        for k in range(count):
            t = poses[k]
            z = t[2, 0] * px + t[2, 1] * py + t[2, 2] * pz + t[2, 3]
            if z < 0.1:
                continue
            x = t[0, 0] * px + t[0, 1] * py + t[0, 2] * pz + t[0, 3]
            y = t[1, 0] * px + t[1, 1] * py + t[1, 2] * pz + t[1, 3]
            u, v = int(np.rint(lens[0] * x / z + lens[2])), int(np.rint(lens[1] * y / z + lens[3]))
            if u < 0 or v < 0 or u >= width or v >= height:
                continue
            seen = plane[rows[k], v, u]
            if np.isnan(seen[0]):
                continue
            r = seen[0] * x + seen[1] * y + seen[2] * z - seen[3]
            e2 = (r / (gate * sigma)) ** 2
            if r < 0 and e2 > 9.0:
                continue  # hidden there
            mx = t[0, 0] * seen[0] + t[1, 0] * seen[1] + t[2, 0] * seen[2]
            my = t[0, 1] * seen[0] + t[1, 1] * seen[1] + t[2, 1] * seen[2]
            mz = t[0, 2] * seen[0] + t[1, 2] * seen[1] + t[2, 2] * seen[2]
            if e2 < 9.0 and mx * normals[i, 0] + my * normals[i, 1] + mz * normals[i, 2] < 0.7:
                continue  # another face of an edge
            agree[n] = 1.0 / (1.0 + e2) if e2 < 9.0 else 0.0
            good += agree[n]
            residual[n] = r
            j = jacobian[n]
            j[0], j[1], j[2] = mx, my, mz
            j[3], j[4], j[5] = py * mz - pz * my, pz * mx - px * mz, px * my - py * mx
            n += 1
        if n == 0:
            continue
        share = _area(pz) * (good / n) ** 2
        total += good * share
        for k in range(n):
            w = share * agree[k] ** 2 / (sigma * sigma)
            if w > 0:
                for a in range(3):
                    for b in range(3):
                        held[a, b] += w * jacobian[k, a] * normals[i, b]
                for a in range(6):
                    g[a] += w * jacobian[k, a] * residual[k]
                    for b in range(a, 6):
                        h[a, b] += w * jacobian[k, a] * jacobian[k, b]
    return total


@njit(cache=True, nogil=True)
def track_system(poses, reference, starts, here, there, lateral, gate, h, g, held):  # type: ignore[no-untyped-def]
    """The same for points `here` (m, 3) of the frame whose tracks references see at `there` (n, 3): the
    i-th's from starts[i] on, in that row's reference. lateral: standard deviation across the view, rad."""
    total = 0.0
    for i in range(len(here)):
        px, py, pz = here[i, 0], here[i, 1], here[i, 2]
        n = starts[i + 1] - starts[i]
        variance = 2.0 * (pixel_sigma(pz, GOOD) ** 2 + (lateral * pz) ** 2)
        good = 0.0
        for o in range(starts[i], starts[i + 1]):
            t = poses[reference[o]]
            ex = t[0, 0] * px + t[0, 1] * py + t[0, 2] * pz + t[0, 3] - there[o, 0]
            ey = t[1, 0] * px + t[1, 1] * py + t[1, 2] * pz + t[1, 3] - there[o, 1]
            ez = t[2, 0] * px + t[2, 1] * py + t[2, 2] * pz + t[2, 3] - there[o, 2]
            good += 1.0 / (1.0 + (ex * ex + ey * ey + ez * ez) / (gate * gate * variance))
        share = _area(pz) * (good / n) ** 2
        total += good * share
        for o in range(starts[i], starts[i + 1]):
            t = poses[reference[o]]
            dx, dy, dz = there[o, 0] - t[0, 3], there[o, 1] - t[1, 3], there[o, 2] - t[2, 3]
            ex = px - (t[0, 0] * dx + t[1, 0] * dy + t[2, 0] * dz)
            ey = py - (t[0, 1] * dx + t[1, 1] * dy + t[2, 1] * dz)
            ez = pz - (t[0, 2] * dx + t[1, 2] * dy + t[2, 2] * dz)
            w = share / ((1.0 + (ex * ex + ey * ey + ez * ez) / (gate * gate * variance)) ** 2 * variance)
            for a in range(3):
                h[a, a] += w
                held[a, a] += w
            h[0, 4] += w * pz
            h[0, 5] -= w * py
            h[1, 3] -= w * pz
            h[1, 5] += w * px
            h[2, 3] += w * py
            h[2, 4] -= w * px
            h[3, 3] += w * (py * py + pz * pz)
            h[4, 4] += w * (px * px + pz * pz)
            h[5, 5] += w * (px * px + py * py)
            h[3, 4] -= w * px * py
            h[3, 5] -= w * px * pz
            h[4, 5] -= w * py * pz
            g[0] += w * ex
            g[1] += w * ey
            g[2] += w * ez
            g[3] += w * (py * ez - pz * ey)
            g[4] += w * (pz * ex - px * ez)
            g[5] += w * (px * ey - py * ex)
    return total


@njit(cache=True, nogil=True)
def _relative(T_ref_world, T_world_cam):  # type: ignore[no-untyped-def]
    out = np.empty((len(T_ref_world), 4, 4))
    for k in range(len(out)):
        np.dot(T_ref_world[k], T_world_cam, out[k])
    return out


@njit(cache=True, nogil=True)
def system(T_world_cam, T_ref_world, rows, depth, tracks, gate):  # type: ignore[no-untyped-def]
    """Normal equations h (6, 6), g (6) of a pose, its agreement, and what holds its shift (3, 3). depth:
    points, normals, plane, lens; tracks: reference, starts, here, there, lateral."""
    h, g, held = np.zeros((6, 6)), np.zeros(6), np.zeros((3, 3))
    poses = _relative(T_ref_world, T_world_cam)
    good = depth_system(poses, rows, depth[0], depth[1], depth[2], depth[3], gate, h, g, held)
    good += track_system(poses, tracks[0], tracks[1], tracks[2], tracks[3], tracks[4], gate, h, g, held)
    for a in range(6):
        for b in range(a):
            h[a, b] = h[b, a]
    return h, g, good, 0.5 * (held + held.T)


@njit(cache=True, nogil=True)
def refine(T_world_cam, T_ref_world, rows, depth, tracks, gate, rounds, least):  # type: ignore[no-untyped-def]
    """The pose after at most `rounds` steps of least squares, fewer once they are below `least` (m, rad)."""
    pose = T_world_cam.copy()
    for _ in range(rounds):
        h, g, _good, _held = system(pose, T_ref_world, rows, depth, tracks, gate)
        for a in range(6):
            h[a, a] += 100.0  # holds what nothing tells
        d = -np.linalg.solve(h, g)
        angle = np.sqrt(d[3] ** 2 + d[4] ** 2 + d[5] ** 2)
        k = np.array([[0.0, -d[5], d[4]], [d[5], 0.0, -d[3]], [-d[4], d[3], 0.0]])
        sine = np.sin(angle) / angle if angle > 1e-6 else 1.0
        versine = (1.0 - np.cos(angle)) / angle**2 if angle > 1e-6 else 0.5
        square, turned = k @ k, np.eye(4)
        for a in range(3):
            for b in range(3):
                turned[a, b] += sine * k[a, b] + versine * square[a, b]
            turned[a, 3] = d[a]
        pose = pose @ turned
        if np.abs(d).max() < least:
            break
    return pose
