#!/usr/bin/env python3
"""Reads any packed terrain file (.iqt of version 2) after FORMAT.md, section 9, and writes its records.

    read_packed_all.py PACKED.iqt OUT

OUT has the record of every sample, of 4, 8 or 16 bytes as section 3 has it; rows from the south, in a row from the west.
To what read_packed.py reads it adds exact and fine records and what edits appended. It needs nothing but Python, and it is slow.
"""
import struct
import sys
import zlib

sys.dont_write_bytecode = True
import packed_exact  # noqa: E402
import packed_fine  # noqa: E402
import read_packed  # noqa: E402
from read_packed import runs  # noqa: E402


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


class Unpacked:
    """Pages of the unpacked file: those that are packed, made of records by slot, and those in runs (9.8)."""

    def __init__(self, data, header, sections, by_slot, inert):
        self.data, self.by_slot, self.inert = data, by_slot, inert
        self.in_page = 4096 // len(inert)
        leaves = runs(sections[2])
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
    header, sections = read_packed.opened(data)
    k, (wide, high), kind = header[0x10], struct.unpack_from("<II", header, 0x14), header[0x11]
    if kind == 1:
        rules, read, written = read_packed.Rules(header), read_packed.tile, lambda record: struct.pack("<HBB", *record)
        inert = written((0, 0, 255))
    else:
        rules, read, written = (packed_fine if kind == 4 else packed_exact).Rules(header), packed_exact.tile, bytes
        inert = rules.inert
    found = read_packed.records(data, header, sections, rules, read)
    by_slot = {slot_of(k, *point): written(record) for point, record in found}
    by_slot.update(Unpacked(data, header, sections, by_slot, inert).edited(header))
    with open(target, "wb") as file:
        file.write(b"".join(by_slot.get(slot_of(k, x, y), inert) for y in range(high) for x in range(wide)))


if __name__ == "__main__":
    main(*sys.argv[1:])
