# Twelve frames; the ears turn by a radian or nearly, and the feet stay.
/ iterations, tips off by / {
  ++frames
  expect($2 == "converged", "a pose that was found")
  match($0, /feet by [0-9.e+-]+/); between(substr($0, RSTART + 8, RLENGTH - 8), 0, 1e-3, "slip of the feet")
  if (frames == 12) { between($(NF - 2), 0.7, 1.1, "turn of an ear"); between($NF, 0.7, 1.1, "turn of the other") }
}
/ cells; joints off by/ { told = 1; between($6, 0, 1e-9, "joints' error") }
END {
  expect(frames == 12, "twelve frames")
  expect(told, "the joints' error")
}
