#!/usr/bin/env python3
"""Reads a packed terrain file (.iqt of version 2) after FORMAT.md, section 9, and writes its records.

    read_packed.py PACKED.iqt OUT

OUT has the record of every sample, of 4, 8 or 16 bytes as section 3 has it; rows from the south, in a row from the west.
It is a second reader, for comparison; it needs nothing but Python, and it is slow.
"""
import math
import struct
import sys
import zlib

sys.dont_write_bytecode = True
import packed_exact  # noqa: E402
import packed_lattice  # noqa: E402

INERT = 0xFF000000


class Bits:
    def __init__(self, data):
        self.number, self.at, self.length = int.from_bytes(data, "little"), 0, 8 * len(data)

    def take(self, count):
        value = self.number >> self.at & (1 << count) - 1
        self.at += count
        return value


def tables(data):
    """For each context its table, as 2,048 of (token, frequency, place)."""
    bits, found, table = Bits(data), [], None
    for _ in range(404):
        if bits.take(1):
            rest, count = bits.take(6), bits.take(7)
            frequency, length = [0] * 64, 0
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


class Segment:
    def __init__(self, data, of_context):
        self.tables, self.lanes = of_context, data[0]
        if self.lanes:
            (count,) = struct.unpack_from("<H", data, 1)
            at = 3 + 4 * self.lanes
            self.states = list(struct.unpack_from(f"<{self.lanes}I", data, 3))
            self.words = iter(struct.unpack_from(f"<{count}H", data, at))
            self.bits = Bits(data[at + 2 * count:])
        else:
            self.bits = Bits(data[1:])

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
            return self.bits.take(16 if context < 256 else 8)
        if token < 16:
            return token
        raw = (token - 16) // 4 + 2
        return ((token - 16) % 4 + 4 << raw) + self.bits.take(raw)

    def value(self, context, turn):
        return self.finished(context, self.token(context, turn))

    def row(self, contexts):
        tokens = [self.token(context, turn) for turn, context in enumerate(contexts)]
        return [self.finished(context, token) for context, token in zip(contexts, tokens)]

    def check(self):
        assert not self.lanes or (all(s == 65536 for s in self.states) and next(self.words, None) is None)
        assert 0 <= self.bits.length - self.bits.at < 8


def unzigzag(value):
    return value >> 1 if value % 2 == 0 else -(value + 1 >> 1)


class Rules:
    """What follows from heights (9.6)."""

    def __init__(self, step, top, steps, spacing):
        self.step_m, self.spacing = step, spacing
        powers = self.powers(16)
        self.errors = [0.0] + [top / powers[246] * powers[c - 1] for c in range(1, 248)]
        self.octaves = self.powers(steps)
        self.known = {}

    @staticmethod
    def powers(steps):
        root, powers = 2.0, [1.0]
        for _ in range(steps.bit_length() - 1):
            root = math.sqrt(root)
        for i in range(1, 256):
            powers.append(2.0 * powers[i - steps] if i % steps == 0 else powers[i - 1] * root)
        return powers

    def ask(self, what, apart):
        if (what, apart) not in self.known:
            self.known[what, apart] = self.find(what, apart)
        return self.known[what, apart]

    def find(self, what, apart):
        if what == "step":
            error = apart * 0.5 * self.step_m * (1.0 + 1e-9)
            return next((c for c in range(248) if self.errors[c] >= error), 247)
        if what in ("east", "north"):
            ground, rise = self.spacing[what == "north"], apart * self.step_m
            radius = math.sqrt(ground * ground + rise * rise) * (1.0 + 1.0 / (1 << 19))
            flat = max(self.spacing)
            return next((c for c in range(255) if flat * self.octaves[c] >= radius), 254)
        apart = min(max(apart, 1), 65535)
        cut = max(apart.bit_length() - 5, 0)
        rise = (apart >> cut << cut) * self.step_m / (2.0 * (1 << what) * self.spacing[0])
        slope = math.sqrt(1.0 + rise * rise)
        return next((c for c in range(256) if self.octaves[c] >= slope), 255)


def tile(segments, rules, octaves, stride_log, is_top, is_last):
    """Records of a tile by place, as far as it gives them."""
    size, out, z, codes = 1 << octaves, {}, {}, {}
    for x, y in ((0, 0), (size, 0), (0, size), (size, size)):
        z[x, y] = segments[0].bits.take(16)
        if is_top:
            out[x, y] = z[x, y] | segments[0].bits.take(8) << 16 | segments[0].bits.take(8) << 24
    delivered = octaves if is_top else 3
    for octave in range(octaves - 1, -1, -1):
        coder, s = segments[2 - min(octave, 2)], 1 << octave
        gives, last = octave < delivered, size
        if octave == delivered - 1:
            codes = {}
        inside = lambda p: (p[0] < last or is_last[0]) and (p[1] < last or is_last[1])
        whites, easts, norths = packed_lattice.vertices(size, s)
        vertices, kinds = whites + easts + norths, {}
        before = lambda marks, p: [marks.get((p[0] - 2 * s, p[1]), 0), marks.get((p[0], p[1] - 2 * s), 0)]
        if gives and coder.bits.take(1):
            for turn, p in enumerate(vertices):
                west, south = before(kinds, p)
                kinds[p] = coder.value(384 + 3 * west + south, turn)
                if kinds[p] == 1:
                    codes[p] = (0, 255)
            radius, turn = 0, 0
            for p in (p for p in vertices if kinds[p] == 2):
                error = 248 + coder.value(400, turn)
                radius = radius + unzigzag(coder.value(401, turn + 1)) & 255
                codes[p], turn = (error, radius), turn + 2
        # Heights.
        e = packed_lattice.coarse(z, size, s)
        around = {}

        def heights(places, first, near, far):
            predicted, contexts = [], []
            for p in places:
                four = [e[p[0] + dx * s, p[1] + dy * s] for dx, dy in near(p)]
                eight = sum(e[p[0] + dx * s, p[1] + dy * s] for dx, dy in far(p))
                predicted.append(10 * sum(four) - eight + 16 >> 5)
                u = 8 * abs(four[0] + four[1] - four[2] - four[3]) + abs(2 * sum(four) - eight)
                u += 2 * (max(four) - min(four))
                length = u.bit_length()
                contexts.append(first + (0 if u < 4 else min(2 * (length - 3) + (u >> length - 2 & 1), 31)))
                around[p] = four
            asked = [i for i, p in enumerate(places) if kinds.get(p) != 1]
            values = iter(coder.row([contexts[i] for i in asked]))
            for i, p in enumerate(places):
                inert = kinds.get(p) == 1
                z[p] = min(max(predicted[i], 0), 65535) if inert else predicted[i] + unzigzag(next(values)) & 65535

        q = min(octave, 3) if gives else 3
        heights(whites, 64 * q, lambda p: packed_lattice.WHITE_NEAR, lambda p: packed_lattice.WHITE_FAR)
        packed_lattice.add_whites(e, z, whites, size, s)
        heights(easts + norths, 64 * q + 32, lambda p: packed_lattice.black_near(p, s), lambda p: packed_lattice.black_far(p, s))
        if not gives:
            continue
        # Codes.
        climbs = lambda p: (p[0] // (2 * s) + p[1] // (2 * s)) % 2 == 0
        white = set(whites)

        def step(p):
            a, b, c, d = around[p]
            ends = a + b if p not in white or climbs(p) else c + d
            return rules.ask("step", abs(2 * z[p] - ends))

        if stride_log == 0 and octave == 0:
            rule = {p: (step(p), 0) for p in easts + norths}
            for x, y in whites:
                beside, along = [(x - 1, y), (x + 1, y)], [(x, y - 1), (x, y + 1)]
                apart = [max(abs(z[x, y] - z[p]) for p in side) for side in (beside, along)]
                error = max([step((x, y))] + [rule[p][0] for p in beside + along])
                rule[x, y] = error, max(rules.ask("east", apart[0]), rules.ask("north", apart[1]))
            for p in vertices:
                codes.setdefault(p, rule[p])
            if coder.bits.take(1):
                other, turn = {}, 0
                for p in (p for p in vertices if not kinds.get(p) and inside(p)):
                    west, south = before(other, p)
                    other[p], turn = coder.value(393 + 2 * west + south, turn), turn + 1
                    if other[p]:
                        error = codes[p][0] + unzigzag(coder.value(402, turn)) & 255
                        radius = codes[p][1] + unzigzag(coder.value(403, turn + 1)) & 255
                        codes[p], turn = (error, radius), turn + 2
        else:
            for places in (whites, easts + norths):
                asked, contexts, radius_contexts, most = [], [], [], []
                for p in (p for p in places if not kinds.get(p) and inside(p)):
                    if p in white:
                        offsets = [(1, -1), (-1, 1)] if climbs(p) else [(-1, -1), (1, 1)]
                    else:
                        offsets = packed_lattice.black_near(p, s)[2:]
                    parents = [codes.get((p[0] + dx * s, p[1] + dy * s), (247, 0)) for dx, dy in offsets]
                    error, radius = min(min(c[0] for c in parents), 247), max(c[1] for c in parents)
                    y = max(error - step(p), 0)
                    u = min(y, 12) + (min(max(y - 12, 0), 12) >> 1) + (min(max(y - 24, 0), 88) >> 3)
                    contexts.append(256 + 32 * (p not in white) + min(u, 29))
                    y = radius - rules.ask(stride_log + octave, max(around[p]) - min(around[p]))
                    q = min(max(y, -6), 5) + (min(max(y - 5, 0), 23) >> 3) + (min(max(y + 6, -8), 0) >> 3)
                    radius_contexts.append(320 + 16 * sum(radius >= v for v in (6, 20, 60)) + q + 7)
                    asked.append(p)
                    most.append((error, radius))
                errors, radii = coder.row(contexts), coder.row(radius_contexts)
                for p, (error, radius), less, more in zip(asked, most, errors, radii):
                    codes[p] = error - less & 255, radius + unzigzag(more) & 255
        for p in vertices:
            if inside(p):
                error, radius = codes[p]
                out[p] = INERT if (error, radius) == (0, 255) else z[p] | error << 16 | radius << 24
            else:
                codes.pop(p, None)
    for segment in segments:
        segment.check()
    return out


def slot_of(k, x, y):
    """Where the unpacked file has the record of a grid point (section 2)."""
    n = 1 << k
    if x % n == 0 and y % n == 0:
        return {(0, 0): 0, (n, 0): 1, (n, n): 2, (0, n): 3}[x, y]
    spread = lambda v: sum((v >> i & 1) << 2 * i for i in range(v.bit_length()))
    t = ((x | y) & -(x | y)).bit_length() - 1
    d, u, w = k - 1 - t, x >> t, y >> t
    if u % 2 and w % 2:
        return (5 * 4**d + 7) // 3 + 2 * spread(w >> 1) + spread(u >> 1 ^ w >> 1)
    a, b = (u + w - 1) // 2, (w - u + 2 ** (d + 1) - 1) // 2
    return (8 * 4**d + 7) // 3 + 2 * spread(a ^ 2**d - 1) + spread(a ^ b ^ 2**d)


def in_runs(data):
    """Numbers of what is present, out of runs of absent and present ones (9.1)."""
    found, at, is_present, shift, run = [], 0, False, 0, 0
    for byte in data:
        run, shift = run | (byte & 127) << shift, shift + 7
        if byte < 128:
            found += range(at, at + run) if is_present else []
            at, is_present, shift, run = at + run, not is_present, 0, 0
    return found


class Unpacked:
    """Pages of the unpacked file: those that are packed, made of records by slot, and those in runs (9.8)."""

    def __init__(self, data, header, sections, by_slot, inert):
        self.data, self.by_slot, self.inert = data, by_slot, inert
        self.in_page = 4096 // len(inert)
        leaves = in_runs(sections[2])
        self.has_nodes = header[0x10] > 17
        self.present = present = []
        tables, at = {leaf: bytearray(4096) for leaf in leaves}, 0
        for leaf, (less, sum_) in zip(leaves, struct.iter_unpack("<BI", sections[3]), strict=True):
            bits = (1 << 256) - 1
            if less < 255:
                bits, at = int.from_bytes(sections[5][at:at + 32], "little"), at + 32
            here = [i for i in range(256) if bits >> i & 1]
            assert len(here) == less + 1
            for i in here:
                struct.pack_into("<I4sI", tables[leaf], 16 * i, 3 + len(present), sections[5][at:at + 4], 1)
                present.append(256 * leaf + i)
                at += 4
            assert zlib.crc32(tables[leaf]) == sum_
        assert at == len(sections[5]) and len(present) == struct.unpack_from("<Q", header, 0x110)[0]
        root = bytearray(-(-16 * struct.unpack_from("<I", header, 0x7C)[0] // 4096) * 4096)
        pages = dict.fromkeys(leaves)
        for i, leaf in enumerate(leaves):
            pages[leaf] = struct.pack("<III", 3 + len(present) + i, zlib.crc32(tables[leaf]), 1)
        behind = b"".join(tables[leaf] for leaf in leaves)
        if self.has_nodes:
            nodes = {leaf // 256: bytearray(4096) for leaf in leaves}
            for leaf, entry in pages.items():
                struct.pack_into("12s", nodes[leaf // 256], 16 * (leaf % 256), entry)
            first = 3 + len(present) + len(leaves)
            pages = {node: struct.pack("<III", first + i, zlib.crc32(page), 1) for i, (node, page) in enumerate(nodes.items())}
            behind += b"".join(nodes.values())
        for i, entry in pages.items():
            struct.pack_into("12s", root, 16 * i, entry)
        behind += root
        self.behind = [behind[at:at + 4096] for at in range(0, len(behind), 4096)]
        self.first, self.runs = 3 + len(present) + len(self.behind), []
        offset, sum_, count = struct.unpack_from("<QII", header, 0x1E8)
        while count:
            block = data[offset:offset + 16 + 24 * count]
            assert zlib.crc32(block) == sum_
            self.runs = [struct.unpack_from("<IIQII", block, 16 + 24 * i) for i in range(count)] + self.runs
            offset, sum_, count = struct.unpack_from("<QII", block)

    def page(self, number):
        if number < 3 + len(self.present):
            first = self.in_page * self.present[number - 3]
            return b"".join(self.by_slot.get(first + i, self.inert) for i in range(self.in_page))
        if number < self.first:
            return self.behind[number - 3 - len(self.present)]
        first, pages, at, kind, sum_ = next(run for run in self.runs if run[0] <= number < run[0] + run[1])
        if kind == 0:
            return self.data[at + 4096 * (number - first):][:4096]
        table = self.data[at:at + 6 * pages]
        assert kind == 1 and zlib.crc32(table) == sum_
        entries = [struct.unpack_from("<IH", table, 6 * i) for i in range(pages)]
        at += 6 * pages + sum(length for _, length in entries[:number - first])
        base, length = entries[number - first]
        page = self.data[at:at + length]
        page = page if length == 4096 else zlib.decompress(page, -15)
        return bytes(a ^ b for a, b in zip(page, self.page(base))) if base else page

    def edited(self, header):
        """Records of pages that were appended, by slot, as far as the directory leads to them (section 5)."""
        root_page, leaves, sum_ = struct.unpack_from("<III", header, 0x78)
        root = b"".join(self.page(root_page + i) for i in range(-(-16 * leaves // 4096)))[:16 * leaves]
        assert zlib.crc32(root) == sum_
        found, listed = {}, enumerate(struct.iter_unpack("<4I", root))
        if self.has_nodes:
            nodes = [(i, node, sum_) for i, (node, sum_, _, _) in listed if node >= self.first]
            assert all(zlib.crc32(self.page(node)) == sum_ for _, node, sum_ in nodes)
            listed = [(256 * i + j, leaf) for i, node, _ in nodes for j, leaf in enumerate(struct.iter_unpack("<4I", self.page(node)))]
        for i, (leaf, sum_, _, _) in listed:
            if leaf < self.first:
                continue
            entries = self.page(leaf)
            assert zlib.crc32(entries) == sum_
            for j, (number, sum_, _, _) in enumerate(struct.iter_unpack("<4I", entries)):
                if number >= self.first:
                    page = self.page(number)
                    assert zlib.crc32(page) == sum_
                    records = (page[at:at + len(self.inert)] for at in range(0, 4096, len(self.inert)))
                    found.update(enumerate(records, self.in_page * (256 * i + j)))
        return found


def main(packed, target):
    with open(packed, "rb") as file:
        data = file.read()
    slots = [data[at:at + 4096] for at in (0, 4096)]
    slots = [page for page in slots if zlib.crc32(page[:0xFFC]) == struct.unpack_from("<I", page, 0xFFC)[0]]
    header = max(slots, key=lambda page: struct.unpack_from("<I", page, 0x1C))
    assert header[:10] == b"\x89IQT\r\n\x1a\n\2\0" and struct.unpack_from("<H", header, 0x100) == (1,)
    sections = {}
    for i in range(header[0x107]):
        kind, sum_, offset, length = struct.unpack_from("<IIQQ", header, 0x120 + 24 * i)
        sections[kind] = data[offset:offset + length]
        assert zlib.crc32(sections[kind]) == sum_
    k, (wide, high) = header[0x10], struct.unpack_from("<II", header, 0x14)
    spacing, (step,) = struct.unpack_from("<dd", header, 0x20), struct.unpack_from("<d", header, 0x38)
    (top,), (steps,) = struct.unpack_from("<d", header, 0x50), struct.unpack_from("<I", header, 0x58)
    of_context, kind = tables(sections[1]), header[0x11]
    if kind == 1:
        rules, inert, read = Rules(step, top, steps, spacing), struct.pack("<I", INERT), tile
    else:
        (base,) = struct.unpack_from("<d", header, 0x30)
        rules, inert, read = packed_exact.Rules(kind, step, base, spacing, k), packed_exact.INERT[kind], packed_exact.tile
    groups = [(3 * g, min(6, k - 3 * g), k - 3 * g <= 6) for g in range(-(-max(k - 6, 0) // 3) + 1)]
    by_slot, leaf, tile_root = {}, 0, sections[4]
    listed = range(len(tile_root) // 12)
    if k > 17:
        places = len(tile_root) - 12 * struct.unpack_from("<I", tile_root)[0]
        listed, tile_root = in_runs(tile_root[4:places]), tile_root[places:]
    tile_root = dict(zip(listed, struct.iter_unpack("<QI", tile_root), strict=True))
    for stride_log, octaves, is_top in reversed(groups):
        shift, side = stride_log + octaves, 1 << k - stride_log - octaves
        tiles = [min(side, (size - 1 >> shift) + 2) for size in (wide, high)]
        for block in ((x, y) for y in range(0, tiles[1], 16) for x in range(0, tiles[0], 16)):
            sizes = [min(16, tiles[axis] - block[axis]) for axis in (0, 1)]
            offset, sum_ = tile_root.get(leaf, (0, 0))
            leaf += 1
            if offset == 0:
                continue
            entries = data[offset:offset + 24 * sizes[0] * sizes[1]]
            assert zlib.crc32(entries) == sum_
            for i in range(sizes[0] * sizes[1]):
                at = block[0] + i % sizes[0], block[1] + i // sizes[0]
                *place, a, b, c, sum_a, sum_b, sum_c = struct.unpack_from("<IHHHHIII", entries, 24 * i)
                place, segments = place[0] | place[1] << 32, []
                for length, sum_ in ((a, sum_a), (b, sum_b), (c, sum_c)):
                    segment = data[place:place + length]
                    assert zlib.crc32(segment) == sum_
                    segments.append(segment)
                    place += length
                if not a:
                    continue
                coders = [Segment(segment, of_context) for segment in segments]
                is_last = [at[axis] + 1 == side for axis in (0, 1)]
                for (x, y), record in read(coders, rules, octaves, stride_log, is_top, is_last).items():
                    x, y = (at[0] << shift) + (x << stride_log), (at[1] << shift) + (y << stride_log)
                    by_slot[slot_of(k, x, y)] = record if kind > 1 else struct.pack("<I", record)
    by_slot.update(Unpacked(data, header, sections, by_slot, inert).edited(header))
    with open(target, "wb") as file:
        file.write(b"".join(by_slot.get(slot_of(k, x, y), inert) for y in range(high) for x in range(wide)))


if __name__ == "__main__":
    main(*sys.argv[1:])
