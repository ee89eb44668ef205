# With joints nothing but the abdomen moves; without, wings and legs go along. Of the lamps only the rigid one is out of reach.
/^bee.pov: / {
  bees++
  between($8, 0, 1e-9, "motion with joints")
  match($0, /by [0-9.]+ without/); between(substr($0, RSTART + 3, RLENGTH - 11), 0.05, 1, "motion without")
}
/^lamp.pov: / { lamps++; off[lamps] = $NF }
END {
  expect(bees == 1, "the bee")
  expect(lamps == 3, "three lamps")
  between(off[1], 0, 0.01, "distance of the soft body"); between(off[3], 0, 0.01, "distance of the soft arms")
  between(off[2], 0.1, 1, "distance of the rigid parts")
}
