"""Decoder of motion files written from docs/motion-format.md alone, to test that page. Slow.

Usage: motion_reference.py FILE. Prints the CRC-32 of the decoded pulses of the first segment: for each pulse the bytes of
its positions, colours and confidences.
"""
import collections
import struct
import sys
import zlib

SHIFTS = [1, 2, 2, 3, 3, 3] + [4] * 6 + [5] * 11 + [6]


class Model:
    """A learnt bit."""

    def __init__(self, p=32768, count=0):
        self.p, self.count = p, count


class Models(dict):
    """Models by any key; new ones where none was used before."""

    def __missing__(self, key):
        self[key] = Model()
        return self[key]

    def copy(self):
        return Models({key: Model(model.p, model.count) for key, model in self.items()})


class RangeDecoder:
    def __init__(self, data):
        self.data, self.at, self.range = data, 0, 2**64 - 1
        self.code = self.word() << 32
        self.code |= self.word()

    def word(self):
        self.at += 4
        return int.from_bytes((self.data[self.at - 4 : self.at] + bytes(4))[:4], "big")

    def split(self, zero):
        bit = int(self.code >= zero)
        self.code -= zero * bit
        self.range = self.range - zero if bit else zero
        if self.range < 2**32:
            self.range <<= 32
            self.code = self.code << 32 | self.word()
        return bit

    def learnt(self, model):
        bit = self.split((self.range >> 16) * model.p)
        model.p += ((32 if bit else 65504) - model.p) >> SHIFTS[model.count]
        model.count = min(model.count + 1, 23)
        return bit

    def even(self, bits=1):
        value = 0
        for _ in range(bits):
            value = 2 * value + self.split(self.range >> 1)
        return value

    def signed16(self):
        value = self.even(16)
        return value - 65536 if value >= 32768 else value

    def integer(self, models, key):
        digits = 0
        while digits < 22 and self.learnt(models[key, "digits", digits]):
            digits += 1
        if digits == 0:
            return 0
        magnitude = 1
        for place in range(1, digits):
            if place == 1:
                bit = self.learnt(models[key, "first", digits])
            elif place == 2:
                bit = self.learnt(models[key, "second", digits, magnitude & 1])
            else:
                bit = self.even()
            magnitude = 2 * magnitude + bit
        return -magnitude if self.even() else magnitude

    def check_end(self):
        assert len(self.data) <= self.at <= len(self.data) + 7


def truncated(number, by):
    quotient = abs(number) // abs(by)
    return quotient if (number < 0) == (by < 0) else -quotient


def sides(triangle):
    return [(triangle[n], triangle[(n + 1) % 3]) for n in range(3)]


def decode_triangles(data, count):
    coder, models = RangeDecoder(data), Models()
    start, end, is_open, triangles = [], [], [], []
    leaving, entering = collections.defaultdict(list), collections.defaultdict(list)
    uses, known = collections.Counter(), 0

    def add(triangle):
        for corner in triangle:
            uses[corner] = min(uses[corner] + 1, 8)
        for u, w in sides(triangle):
            opposite = [e for e in leaving[w][:-17:-1] if is_open[e] and end[e] == u]
            if opposite:
                is_open[opposite[0]] = False
                continue
            leaving[u].append(len(start))
            entering[w].append(len(start))
            start.append(u)
            end.append(w)
            is_open.append(True)
        triangles.append(tuple(triangle))
        return max(known, max(triangle) + 1)

    while True:
        gates = [e for e in range(len(start)) if is_open[e]]
        if not gates:
            if len(triangles) == count:
                break
            corners = []
            for _ in range(3):
                now = max([known] + [c + 1 for c in corners])
                corners.append(coder.even(now.bit_length()) if coder.learnt(models["component"]) else now)
            known = add(corners)
            continue
        a, b = start[gates[-1]], end[gates[-1]]
        kind = 0
        while kind < 4 and not coder.learnt(models[kind, uses[a], uses[b]]):
            kind += 1
        if kind == 4:
            is_open[gates[-1]] = False
            continue
        if kind == 0:
            corner = known
        elif kind == 1:
            corner = end[[e for e in leaving[b][:-17:-1] if is_open[e]][0]]
        elif kind == 2:
            corner = start[[e for e in entering[a][:-17:-1] if is_open[e]][0]]
        else:
            corner = coder.even(known.bit_length())
        known = add((b, a, corner))
    coder.check_end()
    return triangles


class Hierarchy:
    def __init__(self, triangles, vertices):
        near = [set() for _ in range(vertices)]
        for triangle in triangles:
            for u, w in sides(triangle):
                if u != w:
                    near[u].add(w)
                    near[w].add(u)
        near = [sorted(some) for some in near]
        self.coarse = [[] for _ in range(vertices)]
        self.level = [32] * vertices
        removals = []
        for level in range(32):
            before = set(removals)
            for v in reversed(range(vertices)):
                ring = list(near[v])
                if v in before or not 1 <= len(ring) <= 8 or any(self.level[other] == level for other in ring):
                    continue
                heir = min(ring, key=lambda other: len(near[other]))
                if len(near[heir]) > 24:
                    continue
                for other in ring:
                    if other != heir and other not in near[heir]:
                        near[heir].append(other)
                        near[other].append(heir)
                self.coarse[v], self.level[v] = ring, level
                removals.append(v)
            if len(removals) == len(before):
                break
            near = [[other for other in some if self.level[other] == 32] for some in near]
        remaining = [v for v in range(vertices) if self.level[v] == 32]
        for v, other in zip(remaining[1:], remaining):
            self.coarse[v] = [other]
        self.order = remaining + removals[::-1]
        self.weights = []
        for some in self.coarse:
            weights = [4096 // len(some)] * len(some) if some else []
            if some:
                weights[0] += 4096 % len(some)
            self.weights.append(weights)

    def mean(self, v, positions, axis):
        return sum(w * positions[other][axis] for w, other in zip(self.weights[v], self.coarse[v])) >> 8

    def fit(self, positions):
        for v, some in enumerate(self.coarse):
            fitted = self.fitted(positions[v], [positions[other] for other in some]) if len(some) > 1 else None
            self.weights[v] = fitted or self.weights[v]

    @staticmethod
    def fitted(point, others):
        k = len(others)
        total = [sum(axis) for axis in zip(*others)]
        x = [[k * p - s for p, s in zip(other, total)] for other in others + [point]]
        greatest = max(abs(value) for row in x for value in row)
        if greatest == 0:
            return None
        shift = greatest.bit_length() - 8
        x = [[value >> shift if shift > 0 else value << -shift for value in row] for row in x]
        y = x.pop()
        m = [[sum(row[i] * row[j] for row in x) for j in range(3)] for i in range(3)]
        added = (m[0][0] + m[1][1] + m[2][2]) // 32 + 1
        for i in range(3):
            m[i][i] += added

        def cofactor(i, j):
            (a, b), (c, d) = [n for n in range(3) if n != i], [n for n in range(3) if n != j]
            return (-1) ** (i + j) * (m[a][c] * m[b][d] - m[a][d] * m[b][c])

        scale = sum(m[0][j] * cofactor(0, j) for j in range(3)) // 4096
        if scale < 1:
            return None
        solved = [sum(cofactor(j, i) * y[j] for j in range(3)) for i in range(3)]
        weights = [4096 // k + truncated(sum(a * b for a, b in zip(row, solved)), scale) for row in x]
        if max(map(abs, weights)) > 8192:
            return None
        weights[0] += 4096 - sum(weights)
        return weights if abs(weights[0]) <= 8192 else None


class Pulse:
    def __init__(self, hierarchy):
        self.h, self.count = hierarchy, len(hierarchy.order)

    def decode_positions(self, data, references):
        coder = RangeDecoder(data)
        self.q, self.laplacian = [[0] * 3 for _ in range(self.count)], [[0] * 3 for _ in range(self.count)]
        self.sums = [0] * self.count
        coefficients = [[coder.signed16() for _ in range(2 * len(references))] for _ in range(5)]
        self.models = references[0].models.copy() if references else Models()
        for v in self.h.order:
            near, residuals = self.h.coarse[v], []
            around = 8 * sum(self.sums[other] for other in near) // max(len(near), 1) // 3
            if references:
                around = (2 * around + 8 * references[0].sums[v] // 3) // 3
            for axis in range(3):
                mean, features = self.h.mean(v, self.q, axis), []
                for r in references:
                    features += [r.laplacian[v][axis], mean - (16 * r.q[v][axis] - r.laplacian[v][axis])]
                of_class = coefficients[min(self.h.level[v], 4)]
                change = (sum(c * f for c, f in zip(of_class, features)) + 2048) >> 12
                predicted = max(-(2**20), min(2**20, (mean + change + 8) >> 4))
                size = sum(map(abs, residuals))
                expected = [around, (3 * around + 8 * size) // 4, (around + 2 * size) // 2][axis]
                index = min((min(expected, 32768) ** 2 // 2).bit_length(), 19)
                residuals.append(coder.integer(self.models, index))
                self.q[v][axis] = predicted + residuals[-1]
                self.laplacian[v][axis] = 16 * self.q[v][axis] - mean
            self.sums[v] = min(sum(map(abs, residuals)), 255)
        coder.check_end()

    def decode_colours(self, data, references, steps):
        coder = RangeDecoder(data)
        self.colours, self.magnitudes = [[0] * 3 for _ in range(self.count)], [[0] * 3 for _ in range(self.count)]
        weights = [coder.signed16() for _ in range(3)] if references else []
        self.colour_models = references[0].colour_models.copy() if references else Models()

        def before(v, c):
            values = [r.colours[v][c] for r in references[:2]]
            return values[0] if len(values) == 1 else (sum(values) + 1) >> 1

        def clamped(value, c):
            return max(0 if c == 0 else -255, min(255, value))

        for v in self.h.order:
            near, luma = self.h.coarse[v], 0
            k = len(near)
            for c in range(3):
                if references:
                    change = 16 * sum(self.colours[other][c] - before(other, c) for other in near)
                    change = truncated(change, k) if k else 0
                    predicted = clamped(before(v, c) + ((weights[c] * change + 32768) >> 16), c)
                elif k:
                    predicted = (2 * sum(self.colours[other][c] for other in near) + k) // (2 * k)
                else:
                    predicted = 128 if c == 0 else 0
                around = 8 * sum(self.magnitudes[other][c] for other in near) // max(k, 1)
                if references:
                    around = (2 * around + 8 * references[0].magnitudes[v][c]) // 3
                key = (c, min(around.bit_length(), 7), min(abs(luma), 2))
                residual = coder.integer(self.colour_models, key)
                self.colours[v][c] = clamped(predicted + residual * steps[c], c)
                self.magnitudes[v][c] = min(abs(residual), 255)
                luma = residual if c == 0 else luma
        coder.check_end()

    def decode_confidences(self, data, references, levels):
        coder, self.levels = RangeDecoder(data), [0] * self.count
        self.level_models = references[0].level_models.copy() if references else Models()
        bits = (levels - 1).bit_length()
        for v in self.h.order:
            values = [r.levels[v] for r in references[:2]]
            in_time = (sum(values) + len(values) - 1) // len(values) if values else 0
            near = self.h.coarse[v]
            in_space = (sum(self.levels[other] for other in near) + len(near) // 2) // len(near) if near else 0
            node = 1
            for _ in range(bits):
                node = 2 * node + coder.learnt(self.level_models[in_time, in_space, node])
            self.levels[v] = node - (1 << bits)
        coder.check_end()

    def reset_as_template(self):
        self.h.fit(self.q)
        for v in self.h.order:
            self.laplacian[v] = [16 * self.q[v][axis] - self.h.mean(v, self.q, axis) for axis in range(3)]
        self.sums, self.magnitudes = [0] * self.count, [[0] * 3 for _ in range(self.count)]


def rgb(colour):
    luma, co, cg = colour
    middle = luma - (cg >> 1)
    blue = middle - (co >> 1)
    return bytes(max(0, min(255, value)) for value in (blue + co, cg + middle, blue))


def references_of(i, pulses, period):
    if i % period == 0 or i == pulses - 1:
        return []
    low = i - i % period
    high, passed = min(low + period, pulses - 1), []
    while (low + high) // 2 != i:
        middle = (low + high) // 2
        passed.append(high if i < middle else low)
        low, high = (low, middle) if i < middle else (middle, high)
    return [low, high] + passed[::-1][:2]


def decode(segment):
    (pulses, _, period, vertices, count) = struct.unpack_from("<5I", segment, 16)
    flags, levels, *steps = segment[36:41]
    sizes = struct.unpack_from("<3I", segment, 48)
    step, *origin = struct.unpack_from("<4d", segment, 64)
    at = 96 + 16 * pulses
    parts = []
    for size in sizes + tuple(struct.unpack_from("<I", segment, 96 + 16 * i + 8)[0] for i in range(pulses)):
        parts.append(segment[at : at + size])
        at += size
    template = Pulse(Hierarchy(decode_triangles(parts[0], count), vertices))
    template.decode_positions(parts[1], [])
    if flags & 1:
        template.decode_colours(parts[2], [], steps)
    template.reset_as_template()
    done = {}

    def pulse_at(i):
        if i not in done:
            references = [pulse_at(r) for r in references_of(i, pulses, period)]
            colours, confidences = struct.unpack_from("<2I", parts[3 + i])
            record = parts[3 + i][8:]
            positions = len(record) - colours - confidences
            pulse = done[i] = Pulse(template.h)
            pulse.decode_positions(record[:positions], references or [template])
            if flags & 2:
                pulse.decode_colours(record[positions : positions + colours], references or [template], steps)
            if levels:
                pulse.decode_confidences(record[positions + colours :], references, levels)
        return done[i]

    checksum = 0
    for i in range(pulses):
        pulse = pulse_at(i)
        metres = [origin[axis] + q[axis] * step for q in pulse.q for axis in range(3)]
        checksum = zlib.crc32(struct.pack(f"<{len(metres)}f", *metres), checksum)
        if flags & 1:
            source = pulse if flags & 2 else template
            checksum = zlib.crc32(b"".join(map(rgb, source.colours)), checksum)
        if levels:
            values = ((510 * level + levels - 1) // (2 * levels - 2) for level in pulse.levels)
            checksum = zlib.crc32(bytes(values), checksum)
    return checksum


if __name__ == "__main__":
    with open(sys.argv[1], "rb") as file:
        print(decode(file.read()[16:]))
