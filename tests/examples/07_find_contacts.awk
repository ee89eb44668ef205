# More contacts as the body bends towards the table, then an overlap; what stays keeps its id.
/^bent by up to/ {
  states++
  expect($7 >= count, "no fewer contacts than before")
  count = $7
}
/^  [0-9a-f]+ +gap/ { contacts++; if ($3 < deepest) deepest = $3; if (($1 in seen) && seen[$1] == states - 1) kept++; seen[$1] = states }
END {
  expect(states == 5, "five states")
  expect(count >= 2, "contacts in the end")
  expect(deepest < 0, "an overlap")
  expect(kept > 0, "ids that stay")
}
