# Every way finds the overlap by a unit normal. Those of tetrahedra lead up out of the top, and away from the middle, at every depth.
/ contacts, the deepest / {
  ways++
  match($0, /\(.*\)/); split(substr($0, RSTART + 1, RLENGTH - 2), n, ",")
  between(n[1] * n[1] + n[2] * n[2] + n[3] * n[3], 0.95, 1.05, "length of the normal, squared")
}
/^tetrahedra/ {
  tets++
  between(n[3], 0.7, 1, "normal of tetrahedra, upwards")
  expect(n[1] > 0 && n[2] > 0, "a normal away from the lower box's middle")
}
/^FCL +9/ { between(n[3], -0.1, 0.1, "normal of the nearest point, which is on a side by then, upwards") }
END { expect(ways >= 6 && tets == 3, "three depths by each way") }
