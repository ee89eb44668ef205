# Every way finds the overlap; tetrahedra point up to the last, and tell the depth of the face.
/ contacts, the deepest / {
  ways++
  match($0, /\(.*\)/); split(substr($0, RSTART + 1, RLENGTH - 2), n, ",")
  between(n[1] * n[1] + n[2] * n[2] + n[3] * n[3], 0.95, 1.05, "length of the normal, squared")
}
/^tetrahedra/ { tets++; between(n[3], 0.99, 1, "normal of tetrahedra, upwards"); between($8, 0.95 * $2 / 100, 1.05 * $2 / 100, "depth, m") }
END { expect(ways >= 6 && tets == 3, "three depths by each way") }
