# Ten frames, none of which breaks a joint; the shade follows the hand while it can.
/ iterations, hand off by / {
  ++frames
  expect($0 !~ /infeasible/, "a pose that the joints allow")
  match($0, /off by [0-9.]+/); off = substr($0, RSTART + 7, RLENGTH - 7)
  if ($1 <= 2) between(off, 0, 1e-3, "distance of the hand")
}
/^joints and limits off by/ { told = 1; between($6, 0, 1e-9, "joints' and limits' error") }
END {
  expect(frames == 10, "ten frames")
  expect(told, "the joints' error")
}
