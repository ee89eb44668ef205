# The elbow's motor turns it to its stop at 0.8 rad and holds it there; the arms bend; the hinges hold to round-off.
/ s: shoulder / {
  n++
  elbow = $7
  between(elbow, -0.5 - 1e-3, 0.8 + 1e-3, "elbow within its limits, rad")
  bending = $(NF - 1)
  expect(bending > 0, "bending")
  between($4, -1.6, 1.6, "shoulder, rad")
}
/^hinges off by/ { held = 1; between($4, 0, 1e-9, "hinges' error, m") }
END { expect(n == 6 && held, "six moments and the hinges"); between(elbow, 0.799, 0.801, "elbow at the end, rad") }
