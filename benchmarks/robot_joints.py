#!/usr/bin/env python3
"""Joints of real robots against those their files state.

  run:  robot_joints.py LIMBER_JOINTS ROBOT... [-- options of limber-joints]
  see:  per axis of a robot what was found between the link before it and the link behind it: type, confidence, angle
        between the axes, their distance in diagonals of the robot; then the joints found between other links

ROBOT.wrl is one of KUKA's own VRML models as FreeCAD ships them (Debian: apt-get download freecad-common; dpkg-deb -x it;
usr/share/freecad/Mod/Robot/Lib/Kuka/*.wrl). FreeCAD has named the six turning nodes FREECAD_AXIS1 .. 6; each turns its
children about its own y axis. ROBOT.urdf (or a .xacro of one macro) is a robot description beside its meshes (STL, or
COLLADA without nested nodes), those that are seen. A drawn joint counts as right within 0.5 degrees and 1e-3 diagonals,
one of a description within 5 degrees and 2 %: their bearings are where drawings of printed or cast parts have them.

All that moves as one is one link, put together with the axes as the file has them: one mesh with a group a link.
"""
import json
import math
import pathlib
import re
import struct
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET


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
    """Vertices; per link its triangles; per joint (kind, link before it, link behind it, origin, axis)."""

    exact = 0.5, 1e-3  # degrees, diagonals

    def __init__(self):
        self.vertices, self.links, self.axes = [], {}, []

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


class Kuka(Robot):
    def __init__(self, path):
        super().__init__()
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
                self.axes.append(("revolute", link - 1, link, origin, [(tip[i] - origin[i]) / length for i in range(3)]))
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


def stl_triangles(data):
    count = struct.unpack_from("<I", data, 80)[0] if len(data) >= 84 else -1
    if len(data) == 84 + 50 * count:
        floats = [struct.unpack_from("<9f", data, 96 + 50 * i) for i in range(count)]
        return [[f[k:k + 3] for k in (0, 3, 6)] for f in floats]
    corners = [tuple(numbers(m.split()[1:])) for m in re.findall(r"vertex\s+\S+\s+\S+\s+\S+", data.decode("latin-1"))]
    return [corners[i:i + 3] for i in range(0, len(corners), 3)]


def collada_triangles(data):
    """Of all nodes of the scene, each with its own transforms; up axes are left as they are, as robots' readers do."""
    root = ET.fromstring(re.sub(rb' xmlns="[^"]*"', b"", data, count=1))
    unit = float(root.find("asset/unit").get("meter", "1")) if root.find("asset/unit") is not None else 1.0
    meshes = {}
    for geometry in root.iter("geometry"):
        mesh, out = geometry.find("mesh"), []
        sources = {x.get("id"): numbers(x.find("float_array").text.split()) for x in mesh.iter("source")
                   if x.find("float_array") is not None and x.find("float_array").text}
        places = {v.get("id"): next(i.get("source")[1:] for i in v if i.get("semantic") == "POSITION")
                  for v in mesh.iter("vertices")}
        for kind in list(mesh.iter("triangles")) + list(mesh.iter("polylist")):
            inputs = {i.get("semantic"): (int(i.get("offset")), i.get("source")[1:]) for i in kind.iter("input")}
            stride = 1 + max(int(i.get("offset")) for i in kind.iter("input"))
            offset, xyz = inputs["VERTEX"][0], sources[places[inputs["VERTEX"][1]]]
            index = list(map(int, kind.find("p").text.split()))[offset::stride] if kind.find("p") is not None else []
            sizes = list(map(int, kind.find("vcount").text.split())) if kind.tag == "polylist" else [3] * (len(index) // 3)
            at = 0
            for size in sizes:
                c = [xyz[3 * i:3 * i + 3] for i in index[at:at + size]]
                out += [[c[0], c[i], c[i + 1]] for i in range(1, size - 1)]
                at += size
        meshes["#" + geometry.get("id")] = out
    triangles = []

    def walk(node, m):
        for x in node:
            if x.tag == "matrix":
                v = numbers(x.text.split())
                m = matmul(m, [v[4 * r:4 * r + 4] for r in range(4)])
            elif x.tag in ("translate", "rotate", "scale"):
                v = x.text.split()
                m = matmul(m, matrix({{"translate": "translation", "rotate": "rotation", "scale": "scale"}[x.tag]:
                                      v if x.tag != "rotate" else v[:3] + [str(math.radians(float(v[3])))]}))
        for x in node:
            if x.tag == "instance_geometry":
                triangles.extend([moved(m, p) for p in t] for t in meshes[x.get("url")])
            elif x.tag == "node":
                walk(x, m)

    for scene in root.iter("visual_scene"):
        walk(scene, [[unit * (i == j) if i < 3 else float(i == j) for j in range(4)] for i in range(4)])
    return triangles


class Description(Robot):
    """A URDF, or a xacro whose only expressions are prefixes, numbers and properties."""

    exact = 5.0, 0.02

    def __init__(self, path):
        super().__init__()
        self.folder = pathlib.Path(path).resolve().parent
        text = pathlib.Path(path).read_text(errors="replace")
        known = {"pi": math.pi, "radians": math.radians, "prefix": ""}
        for name, value in re.findall(r'<xacro:property\s+name="(\w+)"\s+value="([^"]*)"', text):
            known[name] = value
        text = re.sub(r"\$\{([^}]*)\}", lambda m: str(eval(m.group(1), {}, known)), text)  # the file's own arithmetic
        root = ET.fromstring(text)
        joints = [j for j in root.iter("joint") if j.find("parent") is not None]
        parent = {j.find("child").get("link"): j for j in joints}
        one = {}  # what moves as one by its first link
        for link in root.iter("link"):
            first = link.get("name")
            while first in parent and parent[first].get("type") == "fixed":
                first = parent[first].find("parent").get("link")
            one[link.get("name")] = first
        number = {name: i for i, name in enumerate(sorted(set(one.values())))}
        for link in root.iter("link"):
            place = self.place(link.get("name"), parent)
            for visual in link.findall("visual"):
                mesh = visual.find("geometry/mesh")
                if mesh is not None:
                    self.add(number[one[link.get("name")]], mesh, matmul(place, self.origin(visual)))
        for j in joints:
            if j.get("type") == "fixed":
                continue
            place = self.place(j.find("child").get("link"), parent)
            axis = numbers(j.find("axis").get("xyz").split()) if j.find("axis") is not None else [1.0, 0.0, 0.0]
            origin, tip = moved(place, [0, 0, 0]), moved(place, axis)
            length = math.dist(origin, tip)
            kind = "prismatic" if j.get("type") == "prismatic" else "revolute"
            self.axes.append((kind, number[one[j.find("parent").get("link")]], number[one[j.find("child").get("link")]],
                              origin, [(tip[i] - origin[i]) / length for i in range(3)]))

    @staticmethod
    def origin(element):
        origin = element.find("origin")
        x = numbers((origin.get("xyz", "0 0 0") if origin is not None else "0 0 0").split())
        rpy = numbers((origin.get("rpy", "0 0 0") if origin is not None else "0 0 0").split())
        m = matrix({"translation": x})
        for axis, angle in ((2, rpy[2]), (1, rpy[1]), (0, rpy[0])):
            m = matmul(m, matrix({"rotation": [float(axis == k) for k in range(3)] + [angle]}))
        return m

    def place(self, name, parent):
        if name not in parent:
            return matrix({})
        return matmul(self.place(parent[name].find("parent").get("link"), parent), self.origin(parent[name]))

    def add(self, link, mesh, m):
        name = mesh.get("filename").split("://")[-1]
        file = next((f for folder in [self.folder, *self.folder.parents]
                     for f in (folder / name, folder / name.split("/", 1)[-1]) if f.is_file()), None)
        if file is None:
            return print("robot_joints: %s is left out: it is not there" % name, file=sys.stderr)
        data = file.read_bytes()
        m = matmul(m, matrix({"scale": mesh.get("scale", "1 1 1").split()}))
        for t in collada_triangles(data) if file.suffix.lower() == ".dae" else stl_triangles(data):
            if len(set(map(tuple, t))) == 3:
                first = len(self.vertices)
                self.vertices += [moved(m, p) for p in t]
                self.links.setdefault(link, []).append([first, first + 1, first + 2])


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
    """Prints what was found per axis. Returns how many have the axis right, how many of these the type, too, and how many
    have both in one of their first two hypotheses."""
    lines = right = second = 0
    expected = set()
    for k, (kind, before, behind, origin, axis) in enumerate(robot.axes, 1):
        pair = {before, behind}
        expected.add(frozenset(pair))
        found = [j for j in joints if {j["a"], j["b"]} == pair]
        if not found:
            print("  axis %d: no joint found" % k)
            continue
        any_good = False
        for rank, hypothesis in enumerate([found[0]] + found[0]["alternatives"][:1]):
            angle, distance = off_by(robot, hypothesis, origin, axis)
            line = angle <= robot.exact[0] and (kind == "prismatic" or distance <= robot.exact[1])
            good = line and hypothesis["type"] == kind
            any_good |= good
            lines += line and rank == 0
            right += good and rank == 0
            print("  axis %d%s: %s (%.2f), %.3f degrees off, %.1e diagonals away%s" %
                  (k, ", or" if rank else ", " + kind, hypothesis["type"], hypothesis["confidence"], angle, distance,
                   ", right" if good else ""))
        second += any_good
    for j in joints:
        if frozenset((j["a"], j["b"])) not in expected:
            print("  besides: links %d and %d %s (%.2f)" % (j["a"], j["b"], j["type"], j["confidence"]))
    return lines, right, second


def main():
    arguments = sys.argv[1:]
    options = []
    if "--" in arguments:
        options = arguments[arguments.index("--") + 1:]
        arguments = arguments[:arguments.index("--")]
    if len(arguments) < 2:
        sys.exit(__doc__)
    sums, all_axes = [0, 0, 0], 0
    for path in arguments[1:]:
        robot = Kuka(path) if path.lower().endswith(".wrl") else Description(path)
        with tempfile.TemporaryDirectory() as folder:
            mesh, joints = pathlib.Path(folder, "robot.obj"), pathlib.Path(folder, "joints.json")
            robot.write(mesh)
            subprocess.run([arguments[0], mesh, "--components", "groups", "--no-limits", "-o", joints] + options,
                           check=True, stdout=subprocess.DEVNULL)
            found = json.loads(joints.read_text())["joints"]
        print("%s: %d triangles, %d links, diagonal %.4g" %
              (pathlib.Path(path).name, sum(map(len, robot.links.values())), len(robot.links), robot.diagonal()))
        counts = compare(robot, found)
        print("  %d axes: the axis of %d is that of the first hypothesis, and the type of %d; of the first two %d" %
              (len(robot.axes), *counts))
        sums = [x + y for x, y in zip(sums, counts)]
        all_axes += len(robot.axes)
    print("%d axes: the axis of %d is that of the first hypothesis, and the type of %d; of the first two %d" %
          (all_axes, *sums))


if __name__ == "__main__":
    main()
