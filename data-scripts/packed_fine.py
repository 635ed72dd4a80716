"""Fine records after FORMAT.md, sections 3.4 and 9.10: what packed_exact.py asks of a kind, for kind 4."""
import math
import struct

import packed_exact


class Rules(packed_exact.Rules):
    def __init__(self, header):
        super().__init__(header)
        self.height_bits, self.code_bits, self.inert = 16, 16, b"\0\0\0\xff"
        top, octave = struct.unpack_from("<di", header, 0x50)
        root, powers = 2.0, [1.0]
        for _ in range(6):
            root = math.sqrt(root)
        for i in range(1, 991):
            powers.append(2.0 * powers[i - 64] if i % 64 == 0 else powers[i - 1] * root)
        self.errors = [0.0] + [top / powers[-1] * power for power in powers]
        shares = [(1 + c % 8 / 8) * 2.0 ** (c // 8 - 1) if c >= 8 else c / 8 for c in range(63)]
        self.factors = [1.0 + 2.0**octave * share for share in shares]

    def number(self, bits):
        return float(bits)

    def nearest(self, value):
        return min(max(math.floor(value + 0.5), 0), 65535)

    def order(self, bits):
        return bits

    def back(self, place):
        return place

    def half_of_last_bit(self, bits):
        return packed_exact.half(1.0)

    def error_code(self, metres):
        return next((c for c, error in enumerate(self.errors) if error >= metres), 991)

    def radius_code(self, metres, level):
        return next((c for c, factor in enumerate(self.factors) if self.flat[level] * factor >= metres), 62)

    def error_class(self, most, own):
        y = max(most - own, 0)
        q = y // 4
        return y if y < 4 else min(3 + min(q, 12) + (min(max(q - 12, 0), 12) >> 1) + (min(max(q - 24, 0), 88) >> 3), 30)

    def radius(self, level, colour, parents, slope):
        r, k = max(parents, default=0), 0.5 * slope
        m = r - self.radius_code(self.flat[level] * math.sqrt(1.0 + k * k), level)
        sizes = sum(size <= r for size in (4, 10, 18))
        return r, 16 * sizes + 7 + min(max(m, -7), 5) + (min(max(m - 5, 0), 23) >> 3)

    def record(self, bits, error, radius):
        if error >> 15:
            return struct.pack("<HBB", bits, 248 + error % 8, radius & 255)
        if (error, radius) == (0, 65535):
            return self.inert
        return struct.pack("<HBB", bits, error % 248, 4 * radius + 3 - error // 248)
