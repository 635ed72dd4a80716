"""The lattices of a tile and the neighbours of its vertices after FORMAT.md, section 9.3: what read_packed.py and packed_exact.py have in common."""

WHITE_NEAR = [(-1, -1), (1, 1), (1, -1), (-1, 1)]
WHITE_FAR = [(-3, -1), (-3, 1), (3, -1), (3, 1), (-1, -3), (1, -3), (-1, 3), (1, 3)]
WIDE, TALL = [(-2, -1), (-2, 1), (2, -1), (2, 1)], [(-1, -2), (1, -2), (-1, 2), (1, 2)]


def vertices(size, s):
    """Whites, easts and norths of the octave with half the step s."""
    whites = [(x, y) for y in range(s, size, 2 * s) for x in range(s, size, 2 * s)]
    easts = [(x, y) for y in range(0, size + 1, 2 * s) for x in range(s, size, 2 * s)]
    norths = [(x, y) for y in range(s, size, 2 * s) for x in range(0, size + 1, 2 * s)]
    return whites, easts, norths


def coarse(z, size, s):
    """Heights of the lattice that the octave refines, continued in straight lines over the border."""
    e = {(x, y): z[x, y] for y in range(0, size + 1, 2 * s) for x in range(0, size + 1, 2 * s)}
    for y in range(0, size + 1, 2 * s):
        e[-2 * s, y] = 2 * e[0, y] - e[2 * s, y]
        e[size + 2 * s, y] = 2 * e[size, y] - e[size - 2 * s, y]
    for x in range(-2 * s, size + 2 * s + 1, 2 * s):
        e[x, -2 * s] = 2 * e[x, 0] - e[x, 2 * s]
        e[x, size + 2 * s] = 2 * e[x, size] - e[x, size - 2 * s]
    return e


def add_whites(e, z, whites, size, s):
    """The whites beside the lattice, continued so that the border's edges have the mean of either side."""
    e.update((p, z[p]) for p in whites)
    for y in range(s, size, 2 * s):
        e[-s, y] = e[0, y - s] + e[0, y + s] - e[s, y]
        e[size + s, y] = e[size, y - s] + e[size, y + s] - e[size - s, y]
    for x in range(-s, size + s + 1, 2 * s):
        e[x, -s] = e[x - s, 0] + e[x + s, 0] - e[x, s]
        e[x, size + s] = e[x - s, size] + e[x + s, size] - e[x, size - s]


def black_near(p, s):
    """Steps to the corners of an east's or north's diamond, the ends of its edge first."""
    return [(-1, 0), (1, 0), (0, -1), (0, 1)] if p[0] // s % 2 else [(0, -1), (0, 1), (-1, 0), (1, 0)]


def black_far(p, s):
    """Steps to the eight next coarser vertices of an east or north. The order of a sum of reals decides its last bit."""
    return WIDE + TALL if p[0] // s % 2 else TALL + WIDE
