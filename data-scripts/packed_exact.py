"""Tiles of exact records after FORMAT.md, section 9.9: the part of read_packed_all.py for kinds 2 and 3. Those of packed_fine.py go the same way."""
import math
import struct

from read_packed import AROUND, Lattice, unzigzag as unfold

def half(value):
    return struct.unpack("<Q", struct.pack("<d", abs(value)))[0] >> 51


class Rules:
    def __init__(self, header):
        self.height_bits, self.code_bits, self.mantissa = (32, 16, 23) if header[0x11] == 2 else (64, 32, 52)
        self.spacing, self.flat = struct.unpack_from("<dd", header, 0x20), []
        self.base, self.step_m = struct.unpack_from("<dd", header, 0x30)
        self.inert = b"\0" * 6 + b"\xff\xff" if header[0x11] == 2 else b"\0" * 12 + b"\xff" * 4
        spacing = self.spacing
        for level in range(2 * header[0x10]):
            s = 1 << level // 2
            leg = s * max(spacing) if level % 2 else s / 2 * math.hypot(*spacing)
            self.flat.append((self.flat[-1] if level else 0.0) + (leg if level else 0.0))

    def number(self, bits):
        value = struct.unpack("<f", struct.pack("<I", bits))[0] if self.height_bits == 32 else struct.unpack("<d", struct.pack("<Q", bits))[0]
        return value if math.isfinite(value) else 0.0

    def nearest(self, value):
        if not math.isfinite(value):
            return 0
        if self.height_bits == 64:
            return struct.unpack("<Q", struct.pack("<d", value))[0]
        try:
            return struct.unpack("<I", struct.pack("<f", value))[0]
        except OverflowError:
            return 0

    def order(self, bits):
        sign = 1 << self.height_bits - 1
        return ~bits & 2 * sign - 1 if bits & sign else bits | sign

    def back(self, place):
        sign = 1 << self.height_bits - 1
        return place ^ sign if place & sign else ~place & 2 * sign - 1

    def code(self, metres):
        bits = struct.unpack("<I", struct.pack("<f", metres))[0]
        bits += struct.unpack("<f", struct.pack("<I", bits))[0] < metres
        return -(-bits // 65536) if self.code_bits == 16 else bits

    def metres(self, code):
        code &= (1 << self.code_bits - 1) - 1
        return struct.unpack("<f", struct.pack("<I", code << 32 - self.code_bits))[0]

    def error_code(self, metres):
        return self.code(metres)

    def radius_code(self, metres, level):
        return self.code(metres)

    def step(self, v, ends):
        return self.error_code(abs(v - 0.5 * (ends[0] + ends[1])) * self.step_m * (1.0 + 1e-9))

    def half_of_last_bit(self, bits):
        return half(self.number(bits)) // 2 * 2 - 2 * self.mantissa

    def error_class(self, most, own):
        y = (max(most - own, 0) >> self.code_bits - 16) + 1
        n = y.bit_length()
        return min(2 * (n - 1) + (y >> n - 2 & 1 if n > 1 else 0), 30)

    def radius(self, level, colour, parents, slope):
        """The code from which a radius is told, and its class."""
        if parents and level + 1 < len(self.flat):
            radius = self.metres(max(parents)) * (self.flat[level] / self.flat[level + 1])
        else:
            radius = self.flat[level] * math.sqrt(1.0 + slope * slope)
        kind = min(max(half(slope) - half(1.0) + 12, 0), 15) + (16 if parents else 0)
        return self.code(radius) if math.isfinite(radius) else 0, 32 * colour + kind

    def record(self, bits, error, radius):
        return struct.pack("<IHH" if self.code_bits == 16 else "<QII", bits, error, radius)


def row(coder, bits, largest, places, context):
    """Numbers of vertices, whose context `context` gives by the row's shift."""
    shift = min(coder.take(6), bits - 1)
    heads = coder.row([context(p, shift) for p in places])
    return {p: coder.take(bits) if head == largest else coder.take(shift) | head << shift for p, head in zip(places, heads)}


def single(coder, bits, context, turn):
    (head,) = coder.row([context], turn)
    return coder.take(bits) if head == 255 else head


def tile(segments, rules, octaves, stride_log, is_top, is_last):
    """Records of a tile by place, as far as it gives them."""
    size, out, z, known = 1 << octaves, {}, {}, {}
    hb, cb = rules.height_bits, rules.code_bits
    mask, sign = (1 << cb) - 1, 1 << cb - 1
    for p in ((0, 0), (size, 0), (0, size), (size, size)):
        bits = segments[0].take(hb)
        z[p] = rules.number(bits)
        if is_top:
            error = segments[0].take(cb)
            out[p] = rules.record(bits, error, segments[0].take(cb))
    delivered = octaves if is_top else 3
    for octave in range(octaves - 1, -1, -1):
        coder, s = segments[2 - min(octave, 2)], 1 << octave
        gives = octave < delivered
        if octave == delivered - 1:
            known = {}
        inside = lambda p: (p[0] < size or is_last[0]) and (p[1] < size or is_last[1])
        lattice = Lattice(z, size, s)
        whites, blacks = lattice.whites, lattice.blacks
        vertices, kinds, codes, raw, around = whites + blacks, {}, {}, {}, {}
        before = lambda marks, p: [marks.get((p[0] - 2 * s, p[1]), 0), marks.get((p[0], p[1] - 2 * s), 0)]
        if gives and coder.take(1):
            for turn, p in enumerate(vertices):
                west, south = before(kinds, p)
                (kinds[p],) = coder.row([384 + 3 * west + south], turn)
            error, radius, turn = sign, 0, 0
            for p in (p for p in vertices if kinds[p] == 2):
                error = error + unfold(single(coder, cb, 400, turn)) & mask
                radius = radius + unfold(single(coder, cb, 401, turn + 1)) & mask
                codes[p], turn = (error, radius), turn + 2
        ordinary = [p for p in vertices if not kinds.get(p)]
        # Heights: rows of numbers.
        def heights(places, first):
            uneven = {}
            for p in places:
                a, b, c, d = around[p] = lattice.around(p, 0)
                eight, *others = lattice.around(p, 1)
                for value in others:
                    eight = eight + value
                four = a + b + c + d
                raw[p] = rules.nearest((10.0 * four - eight) / 32.0)
                uneven[p] = 8.0 * abs(a + b - c - d) + abs(2.0 * four - eight) + 2.0 * (max(a, b, c, d) - min(a, b, c, d))

            def context(p, shift):
                return first + min(max(half(uneven[p]) - rules.half_of_last_bit(raw[p]) - 2 * shift - 4, 0), 31)

            found = row(coder, hb, 65535, [p for p in places if kinds.get(p) != 1], context)
            for p in places:
                if p in found:
                    raw[p] = rules.back(rules.order(raw[p]) + unfold(found[p]) & (1 << hb) - 1)
                z[p] = rules.number(raw[p])

        q = min(octave, 3) if gives else 3
        heights(whites, 64 * q)
        heights(blacks, 64 * q + 32)
        if not gives:
            continue
        # Codes.
        step = lambda p: rules.step(z[p], lattice.ends_first(p, around[p])[0])
        if stride_log + octave == 0:
            rule = {p: (step(p), 0) for p in blacks}
            for x, y in whites:
                beside, along = [(x - 1, y), (x + 1, y)], [(x, y - 1), (x, y + 1)]
                error = max([step((x, y))] + [rule[p][0] for p in beside + along if not kinds.get(p)])
                radius = 0.0
                for g, children in zip(rules.spacing, (beside, along)):
                    for w in children:
                        r = z[x, y] * rules.step_m - ((rules.base + z[w] * rules.step_m) - rules.base)
                        radius = max(radius, math.sqrt(g * g + r * r) * (1.0 + 1.0 / (1 << 19)))
                rule[x, y] = error, rules.radius_code(radius, 1)
            codes.update((p, rule[p]) for p in ordinary)
            if coder.take(1):
                other, turn = {}, 0
                for p in (p for p in ordinary if inside(p)):
                    west, south = before(other, p)
                    (other[p],), turn = coder.row([393 + 2 * west + south], turn), turn + 1
                    if other[p]:
                        error = codes[p][0] + unfold(single(coder, cb, 402, turn)) & mask
                        radius = codes[p][1] + unfold(single(coder, cb, 403, turn + 1)) & mask
                        codes[p], turn = (error, radius), turn + 2
        else:
            for colour, places in enumerate((whites, blacks)):
                asked, errors, radii, level = [], {}, {}, 2 * (stride_log + octave) + 1 - colour
                for p in (p for p in places if not kinds.get(p) and inside(p)):
                    corners = [(p[0] + dx * s, p[1] + dy * s) for dx, dy in AROUND[p[0] // s % 2, p[1] // s % 2][0]]
                    parents = [known[q] for q in lattice.ends_first(p, corners)[1] if q in known]
                    reach = max(around[p]) - min(around[p])
                    slope = reach * rules.step_m / ((1 << stride_log + octave) * rules.spacing[0])
                    if parents:
                        most = min(error for error, _ in parents)
                        errors[p] = most, rules.error_class(most, step(p))
                    else:
                        errors[p] = rules.error_code(reach * rules.step_m), 31
                    radii[p] = rules.radius(level, colour, [radius for _, radius in parents], slope)
                    asked.append(p)
                found = row(coder, cb, 255, asked, lambda p, _: 256 + 32 * colour + errors[p][1])
                lies = row(coder, cb, 255, asked, lambda p, _: 320 + radii[p][1])
                for p in asked:
                    most, kind = errors[p]
                    error = most + unfold(found[p]) if kind == 31 else most - found[p]
                    codes[p] = error & mask, radii[p][0] + unfold(lies[p]) & mask
                known.update((p, codes[p]) for p in asked)
        for p in vertices:
            if kinds.get(p) == 1:
                out[p] = rules.inert
            elif inside(p):
                out[p] = rules.record(raw[p], *codes[p])
    for segment in segments:
        segment.check()
    return {p: record for p, record in out.items() if inside(p) or is_top}
