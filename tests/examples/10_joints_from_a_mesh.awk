# Four joints of a lamp are found, they move by a visible angle, stay within their stops, and their anchors hold.
/: confidence / {
  ++joints[$1]
  expect($0 ~ /moved by [0-9.]+ at most/, "how far the joint moved")
  match($0, /moved by [0-9.]+/); moved = substr($0, RSTART + 9, RLENGTH - 9)
  farthest = moved + 0 > farthest ? moved + 0 : farthest
  between($(NF - 3), 0, 1e-9, "beyond its stop")
}
/^anchors off by/ { held = 1; between($4, 0, 1e-10, "anchors' error, of the size") }
END {
  expect(joints["revolute"] == 3 && joints["ball"] == 1, "three hinges and a ball joint")
  expect(farthest > 0.05, "that the lamp swings")
  expect(held, "the anchors' error")
}
