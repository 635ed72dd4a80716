#!/usr/bin/env python3
"""Reads packed terrain of compact records (.iqt, version 2) as it was built, after layout/FORMAT.md alone: heights, errors and radii.

    read_packed.py PACKED.iqt > SAMPLES.csv

A line a sample, rows from the south and in a row from the west; a void has no height. It needs nothing but Python, and it is slow.
What edits changed, and exact or fine records, take the larger reader, read_packed_all.py, which builds on this one.
"""
import functools
import math
import struct
import sys
import zlib

# Steps from a white (1, 1), an east (1, 0) and a north (0, 1) to the corners a, b, c, d of its diamond and to eight vertices around (9.3).
WIDE, TALL = [(-2, -1), (-2, 1), (2, -1), (2, 1)], [(-1, -2), (1, -2), (-1, 2), (1, 2)]
WHITE_FAR = [(-3, -1), (-3, 1), (3, -1), (3, 1), (-1, -3), (1, -3), (-1, 3), (1, 3)]
AROUND = {(1, 1): ([(-1, -1), (1, 1), (1, -1), (-1, 1)], WHITE_FAR),
          (1, 0): ([(-1, 0), (1, 0), (0, -1), (0, 1)], WIDE + TALL),
          (0, 1): ([(0, -1), (0, 1), (-1, 0), (1, 0)], TALL + WIDE)}


class Bits:
    def __init__(self, data):
        self.number, self.at, self.length = int.from_bytes(data, "little"), 0, 8 * len(data)

    def take(self, count):
        self.at += count
        return self.number >> self.at - count & (1 << count) - 1


def tables(data):
    """For each context its table, as 2,048 of (token, frequency, place) (9.5)."""
    bits, found = Bits(data), []
    for _ in range(404):
        if bits.take(1):
            rest, count, frequency, length = bits.take(6), bits.take(7), [0] * 64, 0
            for token in (t for t in range(count) if t != rest):
                steps = 0
                while bits.take(1):
                    steps += 1
                length += (steps + 1) // 2 if steps % 2 else -(steps // 2)
                if length:
                    kept = min(length - 1, 3)
                    frequency[token] = (1 << kept | bits.take(kept)) << length - 1 - kept
            frequency[rest] = 2048 - sum(frequency)
            table = [(t, f, place) for t, f in enumerate(frequency) for place in range(f)]
        found.append(table)
    return found


class Segment(Bits):
    """Values of a segment (9.4)."""

    def __init__(self, data, of_context):
        self.tables, self.lanes, self.states, self.words, at = of_context, data[0], [], iter(()), 1
        if self.lanes:
            at = 3 + 4 * self.lanes + 2 * struct.unpack_from("<H", data, 1)[0]
            self.states = list(struct.unpack_from(f"<{self.lanes}I", data, 3))
            self.words = (word for word, in struct.iter_unpack("<H", data[3 + 4 * self.lanes:at]))
        super().__init__(data[at:])

    def row(self, contexts, turn=0):
        """Values of contexts, of which the first has a turn: all tokens, then all raw bits."""
        return [self.finished(c, t) for c, t in zip(contexts, [self.token(c, turn + i) for i, c in enumerate(contexts)])]

    def token(self, context, turn):
        if not self.lanes:
            return None
        x = self.states[turn % self.lanes]
        token, frequency, place = self.tables[context][x % 2048]
        x = frequency * (x // 2048) + place
        self.states[turn % self.lanes] = x if x >= 65536 else 65536 * x + next(self.words)
        return token

    def finished(self, context, token):
        if token is None:
            return self.take(16 if context < 256 else 8)
        raw = max((token - 16) // 4 + 2, 0)
        return token if token < 16 else ((token - 16) % 4 + 4 << raw) + self.take(raw)

    def check(self):
        assert all(state == 65536 for state in self.states) and next(self.words, None) is None and 0 <= self.length - self.at < 8


def unzigzag(value):
    return value >> 1 if value % 2 == 0 else -(value + 1 >> 1)


class Rules:
    """What codes mean in metres (3.1), and which follow from heights (9.6)."""

    def __init__(self, header):
        self.k, self.spacing = header[0x10], struct.unpack_from("<dd", header, 0x20)
        self.base_m, self.step_m = struct.unpack_from("<dd", header, 0x30)
        top, steps = struct.unpack_from("<dI", header, 0x50)
        errors, self.radii, self.fringe_radii = (self.powers(steps) for steps in (16, steps, 8))
        self.errors = [0.0] + [top / errors[246] * power for power in errors[:247]]
        self.flat = [0.0]
        for level in range(1, 2 * self.k):
            s = 1 << level // 2
            self.flat.append(self.flat[-1] + (s * max(self.spacing) if level % 2 else s / 2 * math.hypot(*self.spacing)))

    @staticmethod
    def powers(steps):
        root, powers = 2.0, [1.0]
        for _ in range(steps.bit_length() - 1):
            root = math.sqrt(root)
        for i in range(1, 256):
            powers.append(2.0 * powers[i - steps] if i % steps == 0 else powers[i - 1] * root)
        return powers

    @functools.cache
    def step(self, apart):
        error = apart * 0.5 * self.step_m * (1.0 + 1e-9)
        return next((code for code in range(248) if self.errors[code] >= error), 247)

    @functools.cache
    def side(self, ground, apart):
        rise = apart * self.step_m
        radius = math.sqrt(ground * ground + rise * rise) * (1.0 + 1.0 / (1 << 19))
        return next((code for code in range(255) if self.flat[1] * self.radii[code] >= radius), 254)

    @functools.cache
    def slope(self, octave, apart):
        apart = min(max(apart, 1), 65535)
        cut = max(apart.bit_length() - 5, 0)
        rise = (apart >> cut << cut) * self.step_m / (2.0 * (1 << octave) * self.spacing[0])
        return next((code for code in range(256) if self.radii[code] >= math.sqrt(1.0 + rise * rise)), 255)

    def metres(self, x, y, height, error, radius):
        """Height, error and radius of the sample at a grid point; a void has no height."""
        tz = [min((v & -v).bit_length() - 1, self.k) if v else self.k for v in (x, y)]
        level = 2 * min(tz) + (tz[0] == tz[1]) if min(tz) < self.k else 0
        s, is_void = 1 << level // 2, error >= 252 or (error, radius) == (0, 255)
        height_m = None if is_void else self.base_m + height * self.step_m
        if error >= 248:
            edge = 2 * s * (math.hypot(*self.spacing) if level % 2 else max(self.spacing))
            return height_m, edge * (1, 16, 256, math.inf)[error % 4], self.flat[level] * self.fringe_radii[radius]
        return height_m, self.errors[error], 0.0 if (error, radius) == (0, 255) else self.flat[level] * self.radii[radius]


class Lattice:
    """Heights of a tile by place, continued over its border for the octave whose vertices lie s from coarser ones (9.3)."""

    def __init__(self, z, size, s):
        self.z, self.size, self.s = z, size, s
        rows = range(s, size, 2 * s), range(0, size + 1, 2 * s)
        self.whites = [(x, y) for y in rows[0] for x in rows[0]]
        self.blacks = [(x, y) for y in rows[1] for x in rows[0]] + [(x, y) for y in rows[0] for x in rows[1]]

    def at(self, x, y):
        if (x, y) in self.z:
            return self.z[x, y]
        # Over the border in straight lines: a white's mirror image and the edge between them, which has the mean of its ends.
        off = self.s if x // self.s % 2 else 0
        if 0 <= y <= self.size:
            edge, mirrored = 0 if x < 0 else self.size, -x if x < 0 else 2 * self.size - x
            return self.at(edge, y - off) + self.at(edge, y + off) - self.at(mirrored, y)
        edge, mirrored = 0 if y < 0 else self.size, -y if y < 0 else 2 * self.size - y
        return self.at(x - off, edge) + self.at(x + off, edge) - self.at(x, mirrored)

    def around(self, p, which):
        """Heights of the corners of a vertex's diamond (0), or of the eight around (1)."""
        return [self.at(p[0] + dx * self.s, p[1] + dy * self.s) for dx, dy in AROUND[p[0] // self.s % 2, p[1] // self.s % 2][which]]

    def ends_first(self, p, four):
        """Of what belongs to the corners of a diamond, that of the ends of the edge that its vertex splits, then that of its parents."""
        is_white, climbs = p[0] // self.s % 2 == p[1] // self.s % 2, (p[0] // (2 * self.s) + p[1] // (2 * self.s)) % 2 == 0
        return (four[2:], four[:2]) if is_white and not climbs else (four[:2], four[2:])


def tile(segments, rules, octaves, stride_log, is_top, is_last):
    """Records of a tile by place, as far as it gives them."""
    size, out, z, codes = 1 << octaves, {}, {}, {}
    for p in ((0, 0), (size, 0), (0, size), (size, size)):
        z[p] = segments[0].take(16)
        if is_top:
            out[p] = z[p], segments[0].take(8), segments[0].take(8)
    delivered = octaves if is_top else 3
    for octave in range(octaves - 1, -1, -1):
        coder, s, gives = segments[2 - min(octave, 2)], 1 << octave, octave < delivered
        lattice, kinds, four = Lattice(z, size, s), {}, {}
        vertices = lattice.whites + lattice.blacks
        before = lambda marks, p: [marks.get((p[0] - 2 * s, p[1]), 0), marks.get((p[0], p[1] - 2 * s), 0)]
        is_given = lambda p: (p[0] < size or is_last[0]) and (p[1] < size or is_last[1])
        if octave == delivered - 1:
            codes = {}
        if gives and coder.take(1):
            for turn, p in enumerate(vertices):
                west, south = before(kinds, p)
                (kinds[p],) = coder.row([384 + 3 * west + south], turn)
            radius = 0
            for turn, p in enumerate(p for p in vertices if kinds[p] == 2):
                (error,), (more,) = coder.row([400], 2 * turn), coder.row([401], 2 * turn + 1)
                radius = radius + unzigzag(more) & 255
                codes[p] = 248 + error, radius
        codes.update((p, (0, 255)) for p in vertices if kinds.get(p) == 1)
        for is_black, places in enumerate((lattice.whites, lattice.blacks)):
            predicted, contexts = {}, {}
            for p in places:
                four[p], eight = lattice.around(p, 0), sum(lattice.around(p, 1))
                a, b, c, d = four[p]
                predicted[p] = 10 * sum(four[p]) - eight + 16 >> 5
                u = 8 * abs(a + b - c - d) + abs(2 * sum(four[p]) - eight) + 2 * (max(four[p]) - min(four[p]))
                grade = 0 if u < 4 else min(2 * (u.bit_length() - 3) + (u >> u.bit_length() - 2 & 1), 31)
                contexts[p] = 64 * (min(octave, 3) if gives else 3) + 32 * is_black + grade
            asked = [p for p in places if kinds.get(p) != 1]
            z.update((p, min(max(predicted[p], 0), 65535)) for p in places)
            z.update((p, predicted[p] + unzigzag(v) & 65535) for p, v in zip(asked, coder.row([contexts[p] for p in asked])))
        ordinary = [p for p in vertices if gives and not kinds.get(p) and is_given(p)]
        step = lambda p: rules.step(abs(2 * z[p] - sum(lattice.ends_first(p, four[p])[0])))
        if gives and stride_log + octave == 0:
            rule = {p: (step(p), 0) for p in lattice.blacks}
            for x, y in lattice.whites:
                easts, norths = [(x, y - 1), (x, y + 1)], [(x - 1, y), (x + 1, y)]
                apart = [max(abs(z[x, y] - z[p]) for p in beside) for beside in (norths, easts)]
                radius = max(map(rules.side, rules.spacing, apart))
                rule[x, y] = max([step((x, y))] + [rule[p][0] for p in easts + norths]), radius
            codes.update((p, rule[p]) for p in vertices if not kinds.get(p))
            if coder.take(1):
                other, turn = {}, 0
                for p in ordinary:
                    west, south = before(other, p)
                    (other[p],) = coder.row([393 + 2 * west + south], turn)
                    if other[p]:
                        (error,), (radius,) = coder.row([402], turn + 1), coder.row([403], turn + 2)
                        codes[p] = rule[p][0] + unzigzag(error) & 255, rule[p][1] + unzigzag(radius) & 255
                    turn += 3 if other[p] else 1
        for is_black, places in enumerate((lattice.whites, lattice.blacks)) if gives and stride_log + octave else ():
            asked, contexts = [p for p in places if p in set(ordinary)], ([], [])
            most = {}
            for p in asked:
                corners = [(p[0] + dx * s, p[1] + dy * s) for dx, dy in AROUND[p[0] // s % 2, p[1] // s % 2][0]]
                parents = [codes.get(q, (247, 0)) for q in lattice.ends_first(p, corners)[1]]
                most[p] = error, radius = min(min(c[0] for c in parents), 247), max(c[1] for c in parents)
                y = max(error - step(p), 0)
                u = min(y, 12) + (min(max(y - 12, 0), 12) >> 1) + (min(max(y - 24, 0), 88) >> 3)
                contexts[0].append(256 + 32 * is_black + min(u, 29))
                y = radius - rules.slope(stride_log + octave, max(four[p]) - min(four[p]))
                q = min(max(y, -6), 5) + (min(max(y - 5, 0), 23) >> 3) + (min(max(y + 6, -8), 0) >> 3)
                contexts[1].append(320 + 16 * sum(radius >= bound for bound in (6, 20, 60)) + q + 7)
            for p, less, more in zip(asked, coder.row(contexts[0]), coder.row(contexts[1])):
                codes[p] = most[p][0] - less & 255, most[p][1] + unzigzag(more) & 255
        for p in vertices if gives else ():
            if is_given(p):
                out[p] = (0 if codes[p] == (0, 255) else z[p], *codes[p])
            else:
                codes.pop(p, None)
    for segment in segments:
        segment.check()
    return out


def runs(data):
    """Numbers of what is present, out of runs of absent and present ones (9.1)."""
    found, at, is_present, shift, run = [], 0, False, 0, 0
    for byte in data:
        run, shift = run | (byte & 127) << shift, shift + 7
        if byte < 128:
            found += range(at, at + run) if is_present else []
            at, is_present, shift, run = at + run, not is_present, 0, 0
    return found


def checked(data, offset, length, checksum):
    part = data[offset:offset + length]
    assert zlib.crc32(part) == checksum, "damaged"
    return part


def opened(data):
    """The header that counts, and the sections (9.1)."""
    slots = [data[at:at + 4096] for at in (0, 4096)]
    slots = [page for page in slots if zlib.crc32(page[:0xFFC]) == struct.unpack_from("<I", page, 0xFFC)[0]]
    header = max(slots, key=lambda page: struct.unpack_from("<I", page, 0x1C))
    assert header[:10] == b"\x89IQT\r\n\x1a\n\2\0" and struct.unpack_from("<H", header, 0x100) == (1,), "no packed terrain"
    sections = [struct.unpack_from("<IIQQ", header, 0x120 + 24 * i) for i in range(header[0x107])]
    return header, {kind: checked(data, offset, length, checksum) for kind, checksum, offset, length in sections}


def records(data, header, sections, rules, read):
    """Pairs of a grid point and its record, which `read` finds in a tile's segments (9.2)."""
    k, (wide, high), of_context, root = header[0x10], struct.unpack_from("<II", header, 0x14), tables(sections[1]), sections[4]
    listed = range(len(root) // 12)
    if k > 17:
        places = len(root) - 12 * struct.unpack_from("<I", root)[0]
        listed, root = runs(root[4:places]), root[places:]
    root, leaf = dict(zip(listed, struct.iter_unpack("<QI", root), strict=True)), -1
    groups = [(3 * g, min(6, k - 3 * g), k - 3 * g <= 6) for g in range(-(-max(k - 6, 0) // 3) + 1)]
    for stride_log, octaves, is_top in reversed(groups):
        shift, side = stride_log + octaves, 1 << k - stride_log - octaves
        tiles = [min(side, (size - 1 >> shift) + 2) for size in (wide, high)]
        for south, west in ((y, x) for y in range(0, tiles[1], 16) for x in range(0, tiles[0], 16)):
            leaf += 1
            across, down = min(16, tiles[0] - west), min(16, tiles[1] - south)
            entries = checked(data, root[leaf][0], 24 * across * down, root[leaf][1]) if root.get(leaf, (0,))[0] else b""
            for i, (low, high_bits, *lengths_and_sums) in enumerate(struct.iter_unpack("<IH3H3I", entries)):
                place, segments = low | high_bits << 32, []
                for length, checksum in zip(lengths_and_sums[:3], lengths_and_sums[3:]):
                    segments.append(checked(data, place, length, checksum))
                    place += length
                if segments[0]:
                    at = west + i % across, south + i // across
                    coders = [Segment(segment, of_context) for segment in segments]
                    is_last = [at[axis] + 1 == side for axis in (0, 1)]
                    for (x, y), record in read(coders, rules, octaves, stride_log, is_top, is_last).items():
                        yield ((at[0] << shift) + (x << stride_log), (at[1] << shift) + (y << stride_log)), record


def main(packed):
    with open(packed, "rb") as file:
        data = file.read()
    header, sections = opened(data)
    if header[0x11] != 1 or struct.unpack_from("<I", header, 0xE8) != (0,):
        sys.exit(f"{packed}: it has exact or fine records or edits, which read_packed_all.py reads")
    rules, (wide, high) = Rules(header), struct.unpack_from("<II", header, 0x14)
    found = dict(records(data, header, sections, rules, tile))
    print("x,y,height_m,error_m,radius_m,height_code,error_code,radius_code")
    for x, y in ((x, y) for y in range(high) for x in range(wide)):
        codes = found.get((x, y), (0, 0, 255))
        print(x, y, *("" if m is None else repr(m) for m in rules.metres(x, y, *codes)), *codes, sep=",")


if __name__ == "__main__":
    main(*sys.argv[1:])
