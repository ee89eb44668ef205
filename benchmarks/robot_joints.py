#!/usr/bin/env python3
"""Joints of real robots against those their files state.

The robots are KUKA's own VRML models as FreeCAD ships them (Debian: apt-get download freecad-common; dpkg-deb -x it;
usr/share/freecad/Mod/Robot/Lib/Kuka/*.wrl). FreeCAD has named the six turning nodes FREECAD_AXIS1 .. 6; each turns its
children about its own y axis.

  run:  robot_joints.py LIMBER_JOINTS ROBOT.wrl... [-- options of limber-joints]
  see:  per axis of a robot what was found between the link before it and the link behind it: type, confidence, angle
        between the axes, their distance in diagonals of the robot; then the joints found between other links

All shapes between two axes are one link, put together with the axes as the file has them: one mesh with a group a link.
"""
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile


def tokens(text):
    text = re.sub(r"#[^\n]*", "", text)
    return re.findall(r'"(?:[^"\\]|\\.)*"|[\[\]{}]|[^\s,\[\]{}]+', text)


class Parser:
    """VRML97 nodes as (type, name, {field: value}); only what the robots use."""

    def __init__(self, text):
        self.tokens, self.at = tokens(text), 0

    def next(self):
        self.at += 1
        return self.tokens[self.at - 1]

    def peek(self, ahead=0):
        return self.tokens[self.at + ahead] if self.at + ahead < len(self.tokens) else ""

    def node(self):
        name = ""
        if self.peek() == "DEF":
            self.next()
            name = self.next()
        kind, fields = self.next(), {}
        assert self.next() == "{", kind
        while self.peek() != "}":
            if self.peek() == "ROUTE":
                self.at += 4
                continue
            field = self.next()
            fields[field] = self.value()
        self.next()
        return kind, name, fields

    def starts_node(self):
        return self.peek() == "DEF" or self.peek(1) == "{"

    def value(self):
        if self.peek() == "[":
            self.next()
            out = []
            while self.peek() != "]":
                out.append(self.node() if self.starts_node() else self.next())
            self.next()
            return out
        if self.starts_node():
            return self.node()
        out = [self.next()]
        while re.fullmatch(r"[-+0-9.eE]+", self.peek()):
            out.append(self.next())
        return out

    def scene(self):
        out = []
        while self.peek():
            if self.peek() == "ROUTE":
                self.at += 4
            else:
                out.append(self.node())
        return out


def numbers(values):
    return [float(v) for v in values]


def matmul(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(4)) for j in range(4)] for i in range(4)]


def moved(m, p):
    return [sum(m[i][k] * p[k] for k in range(3)) + m[i][3] for i in range(3)]


def matrix(fields):
    """translation, rotation, scale of a Transform; none of the robots has a centre or turned scales."""
    assert "center" not in fields and "scaleOrientation" not in fields
    t = numbers(fields.get("translation", ["0"] * 3))
    s = numbers(fields.get("scale", ["1"] * 3))
    x, y, z, angle = numbers(fields.get("rotation", ["0", "0", "1", "0"]))
    n = math.sqrt(x * x + y * y + z * z)
    x, y, z = x / n, y / n, z / n
    c, w = math.cos(angle), math.sin(angle)
    r = [[c + x * x * (1 - c), x * y * (1 - c) - z * w, x * z * (1 - c) + y * w],
         [y * x * (1 - c) + z * w, c + y * y * (1 - c), y * z * (1 - c) - x * w],
         [z * x * (1 - c) - y * w, z * y * (1 - c) + x * w, c + z * z * (1 - c)]]
    return [[r[i][j] * s[j] for j in range(3)] + [t[i]] for i in range(3)] + [[0, 0, 0, 1]]


class Robot:
    def __init__(self, path):
        self.vertices, self.links, self.axes = [], {}, {}
        unit = [[float(i == j) for j in range(4)] for i in range(4)]
        for node in Parser(pathlib.Path(path).read_text(errors="replace")).scene():
            self.walk(node, unit, 0)

    def walk(self, node, m, link):
        kind, name, fields = node
        if kind in ("Transform", "Group"):
            if kind == "Transform":
                m = matmul(m, matrix(fields))
            turning = re.fullmatch(r"FREECAD_AXIS(\d)", name)
            if turning:
                link = int(turning.group(1))
                origin, tip = moved(m, [0, 0, 0]), moved(m, [0, 1, 0])
                length = math.dist(origin, tip)
                self.axes[link] = origin, [(tip[i] - origin[i]) / length for i in range(3)]
            for child in fields.get("children", []):
                if isinstance(child, tuple):
                    self.walk(child, m, link)
        elif kind == "Shape" and fields.get("geometry", ("",))[0] == "IndexedFaceSet":
            faces = fields["geometry"][2]
            xyz = numbers(faces["coord"][2]["point"])
            first = len(self.vertices)
            self.vertices += [moved(m, xyz[i:i + 3]) for i in range(0, len(xyz), 3)]
            clockwise = faces.get("ccw", ["TRUE"]) == ["FALSE"]
            corners = []
            for index in map(int, faces["coordIndex"]):
                if index >= 0:
                    corners.append(first + index)
                    continue
                for i in range(1, len(corners) - 1):
                    t = [corners[0], corners[i], corners[i + 1]]
                    if len(set(t)) == 3:
                        self.links.setdefault(link, []).append(t[::-1] if clockwise else t)
                corners = []

    def diagonal(self):
        used = [self.vertices[v] for ts in self.links.values() for t in ts for v in t]
        return math.dist([min(p[i] for p in used) for i in range(3)], [max(p[i] for p in used) for i in range(3)])

    def write(self, path):
        with open(path, "w") as out:
            for p in self.vertices:
                out.write("v %.9g %.9g %.9g\n" % tuple(p))
            for link in sorted(self.links):
                out.write("g link_%d\n" % link)
                for t in self.links[link]:
                    out.write("f %d %d %d\n" % tuple(v + 1 for v in t))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def off_by(robot, hypothesis, origin, axis):
    """Degrees between the axes and their distance in diagonals; infinite where the hypothesis has no axis."""
    if hypothesis["axis"] is None:
        return math.inf, math.inf
    x = hypothesis["axis"]
    angle = math.atan2(math.dist(cross(x, axis), [0, 0, 0]), abs(sum(p * q for p, q in zip(x, axis))))
    off = [p - q for p, q in zip(hypothesis["origin"], origin)]
    return math.degrees(angle), math.dist(cross(off, axis), [0, 0, 0]) / robot.diagonal()


def compare(robot, joints):
    """Prints what was found per axis. Returns how many have the axis right (0.5 degrees, 1e-3 diagonals), and of those how
    many the type, too."""
    right, lines, expected = 0, 0, set()
    for k, (origin, axis) in sorted(robot.axes.items()):
        pair = {k - 1, k}
        expected.add(frozenset(pair))
        found = [j for j in joints if {j["a"], j["b"]} == pair]
        if not found:
            print("  axis %d: no joint found" % k)
            continue
        for rank, hypothesis in enumerate([found[0]] + found[0]["alternatives"][:2]):
            angle, distance = off_by(robot, hypothesis, origin, axis)
            line = angle <= 0.5 and distance <= 1e-3
            good = line and hypothesis["type"] == "revolute"
            lines += line and rank == 0
            right += good and rank == 0
            print("  axis %d%s: %s (%.2f), %.3f degrees off, %.1e diagonals away%s" %
                  (k, ", or" if rank else "", hypothesis["type"], hypothesis["confidence"], angle, distance,
                   ", right" if good else ""))
    for j in joints:
        if frozenset((j["a"], j["b"])) not in expected:
            print("  besides: links %d and %d %s (%.2f)" % (j["a"], j["b"], j["type"], j["confidence"]))
    return lines, right


def main():
    arguments = sys.argv[1:]
    options = []
    if "--" in arguments:
        options = arguments[arguments.index("--") + 1:]
        arguments = arguments[:arguments.index("--")]
    if len(arguments) < 2:
        sys.exit(__doc__)
    right = lines = all_axes = 0
    for path in arguments[1:]:
        robot = Robot(path)
        with tempfile.TemporaryDirectory() as folder:
            mesh, joints = pathlib.Path(folder, "robot.obj"), pathlib.Path(folder, "joints.json")
            robot.write(mesh)
            subprocess.run([arguments[0], mesh, "--components", "groups", "--no-limits", "-o", joints] + options,
                           check=True, stdout=subprocess.DEVNULL)
            found = json.loads(joints.read_text())["joints"]
        print("%s: %d triangles, %d links, diagonal %.4g" %
              (pathlib.Path(path).name, sum(map(len, robot.links.values())), len(robot.links), robot.diagonal()))
        found_lines, found_right = compare(robot, found)
        lines, right = lines + found_lines, right + found_right
        all_axes += len(robot.axes)
    print("%d axes: %d are the axis or the normal of what was found, %d of them of a revolute joint" %
          (all_axes, lines, right))


if __name__ == "__main__":
    main()
