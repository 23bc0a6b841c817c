#!/usr/bin/env python3
"""Reads the mesh projection box of spherical video V2, written from its specification alone
(github.com/google/spatial-media, docs/spherical-video-v2-rfc.md), to check what `nodal mesh` writes.

  mshp_reader.py compare BOX OBJ    the box and a Wavefront OBJ (x right, y down, z forward) are the same mesh:
                                    prints the triangles and the largest difference of a number
  mshp_reader.py deflate BOX NEW    writes the box NEW, with the same meshes, compressed ("dfl8")
"""
import struct
import sys
import zlib


class Bits:
    def __init__(self, data):
        self.value, self.left = int.from_bytes(data, "big"), 8 * len(data)

    def unsigned(self, count):
        if count > self.left:
            sys.exit("the mesh box ends in the middle")
        self.left -= count
        return self.value >> self.left & (1 << count) - 1

    def delta(self, count):
        code = self.unsigned(count)
        return code // 2 if code % 2 == 0 else -(code + 1) // 2

    def count(self):
        if self.unsigned(1) != 0:
            sys.exit("a reserved bit is set")
        return self.unsigned(31)

    def align(self):
        if self.unsigned(self.left % 8) != 0:
            sys.exit("padding is not 0")


def bits_of(count):
    """ceil(log2(count * 2))"""
    bits = 0
    while 1 << bits < 2 * count:
        bits += 1
    return bits


def boxes(data):
    while data:
        size, name = struct.unpack(">I4s", data[:8])
        if not 8 <= size <= len(data):
            sys.exit(f"the size of a box {name} is {size}, but {len(data)} bytes are left")
        yield name, data[8:size]
        data = data[size:]


def payload(path):
    (name, data), = boxes(open(path, "rb").read())
    version_and_flags, crc, coding = struct.unpack(">II4s", data[:12])
    if name != b"mshp" or version_and_flags != 0:
        sys.exit("this is no mshp box of version 0")
    if crc != zlib.crc32(data[8:]):
        sys.exit("the checksum is wrong")
    return zlib.decompress(data[12:], -15) if coding == b"dfl8" else data[12:]


def triangles_of_box(path):
    (name, data), = boxes(payload(path))
    if name != b"mesh":
        sys.exit("there is no mesh box in it")
    bits = Bits(data)
    coordinates = [struct.unpack(">f", struct.pack(">I", bits.unsigned(32)))[0] for _ in range(bits.count())]
    width, vertices, at = bits_of(len(coordinates)), [], [0] * 5
    for _ in range(bits.count()):
        at = [index + bits.delta(width) for index in at]
        vertices.append([coordinates[index] for index in at])
    bits.align()
    width, triangles = bits_of(len(vertices)), []
    for _ in range(bits.count()):
        if bits.unsigned(8) != 0 or bits.unsigned(8) != 0:
            sys.exit("this is no list of triangles of texture 0")
        index, corners = 0, []
        for _ in range(bits.count()):
            index += bits.delta(width)
            corners.append(vertices[index])
        bits.align()
        triangles += [corners[k : k + 3] for k in range(0, len(corners), 3)]
    if bits.left != 0:
        sys.exit("there is something behind the mesh")
    return triangles


def triangles_of_obj(path):
    points, textures, triangles = [], [], []
    for words in map(str.split, open(path)):
        if words[0] == "v":
            x, y, z = map(float, words[1:])
            points.append([x, -y, -z])
        elif words[0] == "vt":
            textures.append([float(word) for word in words[1:]])
        elif words[0] == "f":
            pairs = [[int(number) - 1 for number in word.split("/")] for word in words[1:]]
            triangles.append([points[v] + textures[vt] for v, vt in pairs])
    return triangles


def compare(box, obj):
    read, expected = triangles_of_box(box), triangles_of_obj(obj)
    if len(read) != len(expected):
        sys.exit(f"{len(read)} triangles, and {len(expected)} in the OBJ")
    largest = 0
    for number, (one, other) in enumerate(zip(read, expected), 1):
        for a, b in zip(one, other):
            largest = max([largest] + [abs(x - y) for x, y in zip(a, b)])
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (corner[:3] for corner in one)
        volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
        if not volume < 0:
            sys.exit(f"triangle {number} is not counter-clockwise as the origin sees it")
    print(len(read), largest)


def deflate(box, new):
    coder = zlib.compressobj(9, zlib.DEFLATED, -15)
    coded = b"dfl8" + coder.compress(payload(box)) + coder.flush()
    content = struct.pack(">II", 0, zlib.crc32(coded)) + coded
    open(new, "wb").write(struct.pack(">I4s", 8 + len(content), b"mshp") + content)


if __name__ == "__main__":
    {"compare": compare, "deflate": deflate}[sys.argv[1]](*sys.argv[2:])
